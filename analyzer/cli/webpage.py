"""The page of `open --web`: the terminal, and words until it stands and after it has ended. It loads nothing from
elsewhere: its fonts are those that the server has."""

from __future__ import annotations

from typing import Final

from ..languages import tr

_PAGE: Final = """\
<!DOCTYPE html>
<html lang="{{ language }}">
  <head>
    <meta charset="utf-8">
    <meta name="viewport" content="width=device-width, initial-scale=1">
    <title>{{ title }}</title>
    <link rel="icon" href="data:,">
    <link rel="stylesheet" href="{{ static }}css/xterm.css">
    <script src="{{ static }}js/textual.js"></script>
    <style>
      @font-face {
        font-family: "Roboto Mono";
        src: url("{{ static }}fonts/RobotoMono-VariableFont_wght.ttf");
        font-weight: 100 700;
      }
      html, body { margin: 0; height: 100%; background: #16191d; color: #d7dae0; }
      body, button { font: 16px "Roboto Mono", Menlo, Consolas, monospace; }
      .words {
        position: absolute; inset: 0; z-index: 10; display: flex; flex-direction: column; gap: 16px;
        align-items: center; justify-content: center; background: #16191d; text-align: center;
      }
      button { padding: 8px 24px; color: inherit; background: #272c33; border: 1px solid #3a414a; cursor: pointer; }
      button:hover, button:focus { background: #2f5f8f; }
      .xterm .xterm-viewport { background: #16191d !important; scrollbar-width: none; }
      .closed { display: none; }
      body.-first-byte .starting { display: none; }
      body.-closed .closed { display: flex; }
      #start { display: none; }
      #start.-delay { display: block; }
    </style>
  </head>
  <body>
    <div class="words starting intro-dialog"><div>{{ starting }}</div>
      <button type="button" id="start" onclick="location.reload()">{{ again }}</button></div>
    <div class="words closed closed-dialog"><div>{{ ended }}</div>
      <button type="button" onclick="location.reload()">{{ again }}</button></div>
    <div id="terminal" class="textual-terminal" data-session-websocket-url="{{ socket }}" data-font-size="16"></div>
    <script>
      // Keys are meant for the terminal, from the first byte on and whenever the page is come back to.
      const typed = () => document.querySelector("#terminal textarea")?.focus();
      new MutationObserver(typed).observe(document.body, {attributeFilter: ["class"]});
      addEventListener("focus", typed);
    </script>
  </body>
</html>
"""


def page(title: str, socket: str, static: str, language: str) -> str:
    """The page of one address: where its socket is, and where the server's files are."""
    from jinja2 import Environment

    return (
        Environment(autoescape=True)
        .from_string(_PAGE)
        .render(
            title=title, socket=socket, static=static, language=language,
            starting=tr("rtuscope is starting …"), ended=tr("This view has ended."), again=tr("Open it again"),
        )
    )  # fmt: skip
