"""How templates of pages are filled: every string is made harmless and escaped, words come from the catalogue.

Names and strings come from files and devices that anybody may have written.
"""

from __future__ import annotations

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from dissectors.values import harmless

from ...languages import counted, grouped, in_use, page_words, tr
from ...version import __version__


def page_environment(package: str | None = None) -> Environment:
    """Templates of this package, after those of another one if there is one; `w` and `grade` tell words."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(each, "") for each in (package, __package__) if each]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: harmless(value) if type(value) is str else value,
    )
    environment.filters["grouped"] = grouped
    environment.globals.update(w=page_words, grade=tr, counted=counted, language=in_use(), version=__version__)
    return environment
