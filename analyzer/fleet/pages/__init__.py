"""A fleet as HTML: one page with a row a site, and in a folder beside it a page a site, with its causes.

Self-contained files: no script, nothing fetched. All of it comes from the small tables (`hours`, `causes`, `captures`),
so it costs the same whatever the frames are. `questions` asks the lake, `sites` says what a page has, `files` fills the
templates, names the pages and puts them where they belong.
"""

from .files import site_folder, write_pages

__all__ = ["site_folder", "write_pages"]
