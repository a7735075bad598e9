"""Man pages in roff: gestured(8); gesturectl(1) and gestured-bridge(1) with all subcommands; gestured.toml(5)."""

import argparse

from deploy.generate import configuration
from deploy.generate.programs import PARSERS, arguments, commands
from gestured import __version__

PROGRAMS = {  # by name: section, summary
    "gestured": (8, "tactile gesture recognition daemon"),
    "gesturectl": (1, "operator's client of gestured"),
    "gestured-bridge": (1, "gestured on other buses, and serial sensors"),
}
FILE = "TOML. Flags win over GESTURED_* variables, these over the file. An unknown key is an error."


def escape(text: str) -> str:
    """A text whose backslashes, hyphens, leading dots and apostrophes roff shows as they are."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line.startswith((".", "'")) else line for line in text.splitlines())


def tagged(tag: str, text: str) -> list[str]:
    """The lines of a paragraph under a bold tag."""
    return [".TP", f"\\fB{escape(tag)}\\fR", escape(text)]


def described(parser: argparse.ArgumentParser) -> list[str]:
    """The lines about a program's arguments and, unfilled, its examples."""
    words, lines = parser._get_formatter(), []  # argparse has no public way to get these texts
    for action in arguments(parser):
        lines += tagged(words._format_action_invocation(action), words._expand_help(action))
    return [*lines, ".PP", ".nf", escape(parser.epilog), ".fi"] if parser.epilog else lines


def synopsis(parser: argparse.ArgumentParser) -> str:
    """The call of a program in one line."""
    words = parser._get_formatter()
    names = [words._format_action_invocation(action) for action in arguments(parser) if not action.option_strings]
    return escape(" ".join([parser.prog, "[OPTION]...", *(["COMMAND", "..."] if commands(parser) else names)]))


def program(name: str) -> list[str]:
    """The lines of the body of a program's page."""
    parser = PARSERS[name]()
    lines = [".SH SYNOPSIS", synopsis(parser), ".SH DESCRIPTION", escape(parser.description or "")]
    lines += [".SH OPTIONS", *described(parser)]
    for number, command in enumerate(commands(parser)):
        lines += [".SH COMMANDS"] if number == 0 else []
        lines += [f".SS {escape(command.prog)}", escape(command.description or ""), ".PP", synopsis(command)]
        lines += described(command)
    return lines


def file() -> list[str]:
    """The lines of the body of the configuration file's page."""
    lines = [".SH DESCRIPTION", escape(FILE)]
    for table, keys in configuration.tables().items():
        lines.append(f'.SH "TABLE {escape(table.upper())}"' if table else ".SH KEYS")
        for key in keys:
            lines += tagged(key.written, key.text)
    return lines


def pages() -> dict[str, str]:
    """By file name: the page."""
    names = PROGRAMS | {"gestured.toml": (5, "configuration of the gestured daemon")}
    found = {}
    for name, (section, summary) in names.items():
        head = f'.TH {escape(name).upper()} {section} "" "gestured {__version__}"'
        others = ", ".join(f"{other}({number})" for other, (number, _) in names.items() if other != name)
        body = program(name) if name in PROGRAMS else file()
        lines = [head, ".SH NAME", f"{escape(name)} \\- {escape(summary)}", *body, ".SH SEE ALSO", escape(others)]
        found[f"{name}.{section}"] = "\n".join(lines) + "\n"
    return found
