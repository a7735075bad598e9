"""Man pages in roff: gestured(8); gesturectl(1) and gestured-bridge(1) with all subcommands; gestured.toml(5)."""

from collections.abc import Iterable, Iterator

from deploy.generate import configuration
from deploy.generate.programs import Option, Program
from gestured import __version__

OTHERS = ("gestured(8)", "gesturectl(1)", "gestured-bridge(1)", "gestured.toml(5)")


def escape(text: str) -> str:
    """Text as roff shows it: no backslash, hyphen or leading dot means anything."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line.startswith((".", "'")) else line for line in text.splitlines())


def heading(name: str, section: int, summary: str) -> list[str]:
    """Title and NAME."""
    title = escape(name)
    return [f'.TH {title.upper()} {section} "" "gestured {__version__}"', ".SH NAME", f"{title} \\- {escape(summary)}"]


def verbatim(text: str) -> list[str]:
    """Lines that are neither filled nor joined."""
    return [".PP", ".nf", escape(text), ".fi"] if text.strip() else []


def tagged(tag: str, text: str) -> list[str]:
    """A paragraph under a bold tag."""
    return [".TP", f"\\fB{escape(tag)}\\fR", escape(text)]


def described(options: Iterable[Option]) -> Iterator[str]:
    """The list of arguments."""
    for option in options:
        flags = ", ".join(option.flags)
        yield from tagged(" ".join(filter(None, (flags, option.metavar))), option.help)


def synopsis(program: Program) -> str:
    """How it is called, in one line."""
    arguments = [option.metavar for option in program.options if not option.flags]
    rest = ["COMMAND", "..."] if program.commands else arguments
    return escape(" ".join([program.name, "[OPTION]...", *rest]))


def program_page(program: Program, section: int) -> str:
    """The page of a program."""
    lines = [*heading(program.name, section, program.summary), ".SH SYNOPSIS", synopsis(program)]
    lines += [".SH DESCRIPTION", escape(program.text), ".SH OPTIONS", *described(program.options)]
    if program.commands:
        lines.append(".SH COMMANDS")
    for command in program.commands:
        lines += [f".SS {escape(command.name)}", escape(command.text), ".PP", synopsis(command)]
        lines += [*described(command.options), *verbatim(command.examples)]
    if program.examples:
        lines += [".SH NOTES", *verbatim(program.examples)]
    return finish(lines, program.name)


def configuration_page() -> str:
    """The page of the configuration file."""
    lines = [*heading("gestured.toml", 5, "configuration of the gestured daemon"), ".SH DESCRIPTION"]
    lines.append(escape("TOML. Flags win over GESTURED_* variables, these over the file. An unknown key is an error."))
    for table, keys in configuration.tables().items():
        lines += [".SH KEYS" if not table else f'.SH "TABLE {escape(table.upper())}"']
        for key in keys:
            lines += tagged(key.written, key.text)
    return finish(lines, "gestured.toml")


def finish(lines: list[str], name: str) -> str:
    """Add the other pages."""
    others = ", ".join(other for other in OTHERS if other.partition("(")[0] != name)
    return "\n".join([*lines, ".SH SEE ALSO", escape(others)]) + "\n"


def pages(programs: Iterable[Program]) -> dict[str, str]:
    """File name -> page."""
    found = {"gestured.toml.5": configuration_page()}
    for program in programs:
        section = 8 if program.name == "gestured" else 1
        found[f"{program.name}.{section}"] = program_page(program, section)
    return found
