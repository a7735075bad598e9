"""`python -m deploy.generate`: prints configuration, dashboard or animation; writes man pages and completions."""

import sys
from pathlib import Path

from deploy.generate import animation, completion, configuration, dashboard, man, programs


def install(share: Path) -> None:
    """Write man pages and completions below the folder `share`."""
    for name, text in man.pages().items():
        put(share / "man" / f"man{name[-1]}" / name, text)
    for name, parser in programs.PARSERS.items():
        put(share / "bash-completion" / "completions" / name, completion.completion(parser(), "bash"))
        put(share / "zsh" / "vendor-completions" / f"_{name}", completion.completion(parser(), "zsh"))
        put(share / "fish" / "vendor_completions.d" / f"{name}.fish", completion.completion(parser(), "fish"))


def put(path: Path, text: str) -> None:
    """Write a file, and make the folders above it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["configuration"]:
            print(configuration.example(), end="")
        case ["dashboard"]:
            print(dashboard.dashboard(), end="")
        case ["animation", recording]:
            print(animation.animation(Path(recording)), end="")
        case ["install", share]:
            install(Path(share))
        case _:
            sys.exit("usage: python -m deploy.generate configuration | dashboard | animation RECORDING | install SHARE")
