"""`rtuscope completion`: the script that lets a shell complete commands and options."""

from __future__ import annotations

import argparse
import sys

from ..terminal_text import trusted

EXAMPLE = "rtuscope completion bash"

WHERE = """\
bash        rtuscope completion bash > ~/.local/share/bash-completion/completions/rtuscope
zsh         rtuscope completion zsh > _rtuscope   (in a folder of $fpath)
fish        rtuscope completion fish > ~/.config/fish/completions/rtuscope.fish
powershell  rtuscope completion powershell >> $PROFILE
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.description = f"{parser.description}\n\nwhere it goes:\n" + "".join(
        f"  {line}\n" for line in WHERE.splitlines()
    )
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "powershell"), help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from argcomplete.shell_integration import shellcode

    sys.stdout.write(trusted(shellcode(["rtuscope"], shell=arguments.shell)))  # with tabs
    return 0
