"""Documentation that is made from the registries: a generator a page."""
