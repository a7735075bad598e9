"""Completions for bash, zsh and fish."""

import re
from collections.abc import Iterator

from deploy.generate.programs import Option, Program

# Of what a flag, or what stands by itself, takes names.
NAMES = {
    **dict.fromkeys(("--gesture", "--gestures", "GESTURE"), "gestures"),
    "--types": "types",
    "--sensor": "sensors",
}
PATHS = ("FILE", "PATH", "FOLDER", "MODEL", "RECORDING")  # words in a metavar that mean something on disk


def takes_path(option: Option) -> bool:
    """Whether its value is a file."""
    return any(word in option.metavar.upper() for word in PATHS)


def words(program: Program) -> list[str]:
    """What may come next, but for values."""
    flags = [flag for option in program.options for flag in option.flags]
    positional = [choice for option in program.options if not option.flags for choice in option.choices]
    return [*(command.name.split()[-1] for command in program.commands), *positional, *flags]


def bash(program: Program) -> str:
    """A bash completion: subcommands, flags, choices, files."""
    function = "_" + program.name
    lines = [
        f"# bash completion for {program.name}, made from its help",
        f"{function}() {{",
        "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} command=${COMP_WORDS[1]} words",
        "    COMPREPLY=()",
    ]
    parts = [(command.name.split()[-1], command) for command in program.commands]
    lines.append('    case "$command $before" in')
    for name, part in [*parts, ("*", program)]:
        lines += list(_values(name, part))
    lines += ["    esac", '    case "$command" in']
    asked = 'COMPREPLY=($(compgen -W "$(gesturectl names {} 2>/dev/null)" -- "$word"))'
    for name, part in parts:
        files = any(not option.flags and takes_path(option) for option in part.options)
        positional = [NAMES[option.metavar] for option in part.options if option.metavar in NAMES]
        own = f"; [[ $word == -* ]] || {asked.format(positional[0])}" if positional else _files(files)
        lines.append(f'        {name}) words="{" ".join(words(part))}"{own} ;;')
    lines += [
        f'        *) words="{" ".join(words(program))}" ;;',
        "    esac",
        *(['    [ "$COMP_CWORD" -gt 1 ] || words="' + " ".join(words(program)) + '"'] if parts else []),
        '    COMPREPLY+=($(compgen -W "$words" -- "$word" || :))',
        "}",
        f"complete -F {function} {program.name}",
    ]
    return "\n".join(lines) + "\n"


def _files(wanted: bool) -> str:
    return '; [[ $word == -* ]] || COMPREPLY=($(compgen -f -- "$word"))' if wanted else ""


def _values(name: str, program: Program) -> Iterator[str]:
    """What follows a flag that takes a value."""
    for option in program.options:
        if option.flags and option.metavar:
            pattern = "|".join(f'"{name} {flag}"' if name != "*" else f'*" {flag}"' for flag in option.flags)
            source = f'-W "{" ".join(option.choices)}"' if option.choices else "-f" if takes_path(option) else ""
            reply = f'COMPREPLY=($(compgen {source} -- "$word")); return' if source else "return"
            if (kind := next((NAMES[flag] for flag in option.flags if flag in NAMES), None)) is not None:
                # After a comma the next name begins.
                listed = f'-P "${{word%"${{word##*,}}"}}" -W "$(gesturectl names {kind} 2>/dev/null)"'
                reply = f'COMPREPLY=($(compgen {listed} -- "${{word##*,}}")); return'
            yield f"        {pattern}) {reply} ;;"


def fish(program: Program) -> str:
    """A fish completion with the words of the help."""
    lines = [f"# fish completion for {program.name}, made from its help"]
    for command in program.commands:
        name = command.name.split()[-1]
        lines.append(f"complete -c {program.name} -f -n __fish_use_subcommand -a {name} -d {_quoted(command.summary)}")
        seen = f"-n '__fish_seen_subcommand_from {name}'"
        lines += [f"complete -c {program.name} {seen} {flag}" for flag in _fish_flags(command)]
    top = "-n __fish_use_subcommand " if program.commands else ""
    lines += [f"complete -c {program.name} {top}{flag}" for flag in _fish_flags(program)]
    return "\n".join(lines) + "\n"


def _fish_flags(program: Program) -> Iterator[str]:
    for option in program.options:
        long = [flag[2:] for flag in option.flags if flag.startswith("--")]
        if long:
            value = f" -x -a {_quoted(' '.join(option.choices))}" if option.choices else " -r" if option.metavar else ""
            yield f"-l {long[0]}{value} -d {_quoted(option.help)}"


def zsh(program: Program) -> str:
    """A zsh completion with the words of the help."""
    function = "_" + program.name
    lines = [f"#compdef {program.name}", f"# zsh completion for {program.name}, made from its help", f"{function}() {{"]
    if not program.commands:
        lines.append(_arguments(program))
    else:
        found = [(command.name.split()[-1], command) for command in program.commands]
        lines += [
            "local curcontext=$curcontext state line",
            _arguments(program, "-C", "'1: :->command'", "'*:: :->rest'"),
            "case $state in",
            "command)",
            "local -a commands=(",
            *(_literal(f"{name}:{command.summary}") for name, command in found),
            ")",
            "_describe command commands ;;",
            "rest)",
            "case $line[1] in",
            *(f"{name})\n{_arguments(command)} ;;" for name, command in found),
            "esac ;;",
            "esac",
        ]
    return "\n".join([*lines, "}", f'{function} "$@"']) + "\n"


def _arguments(program: Program, *first: str) -> str:
    """A call of zsh's _arguments: each flag with its words and its kind of value, then what stands by itself."""
    specs = list(first)
    for option in program.options:
        kind = f"({' '.join(option.choices)})" if option.choices else "_files" if takes_path(option) else " "
        value = f":{option.metavar.replace(':', '')}:{kind}" if option.metavar else ""
        words = re.sub(r"[\[\]\\]", r"\\\g<0>", " ".join(option.help.split()))
        specs += [_literal(f"*{flag}[{words}]{value}" if value else f"{flag}[{words}]") for flag in option.flags]
        if not option.flags:
            specs.append(_literal(value))
    return "_arguments " + " \\\n    ".join(specs)


def _literal(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
