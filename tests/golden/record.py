"""Record what the golden tapes give now: `python -m tests.golden.record`, or of some: `... record faults stalls_long`.

With `--add TAPE.mcap` what `gesturectl record` has written is kept as one more tape of the group. Look at `git diff`
afterwards: each line that changed is an event, or a segment, that a user gets differently.
"""

import argparse
import hashlib
import json
import sys
from collections import Counter
from pathlib import Path

from gestured.daemon import log
from tests.golden import expected, path, segments, tape
from tests.golden.real import SESSIONS, real
from tests.golden.tape import GROUPS


def main() -> int:
    """Write the tapes and what is expected of them; say what changed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("groups", nargs="*", help=f"of {', '.join((*GROUPS, 'real'))} (default: all)")
    parser.add_argument("--add", type=Path, metavar="TAPE.mcap", help="a tape more in this group, which may be new")
    args = parser.parse_args()
    if args.add:
        (group,) = args.groups
        tapes = tape.read(group) if group in GROUPS else []
        print(f"{group}: {tape.write(group, [*tapes, path.recorded(args.add)]):,} bytes of tape")
    elif unknown := set(args.groups) - {*GROUPS, "real"}:
        parser.error(f"{', '.join(sorted(unknown))}: no group, expected some of {', '.join((*GROUPS, 'real'))}")
    log.configure("error")
    model = path.open_model()
    kinds: Counter[str] = Counter()
    number = size = 0
    for group in args.groups or (*GROUPS, "real"):
        if group == "real" and not SESSIONS.exists():
            print(f"real: left as it is, there is no {SESSIONS}")
            continue
        for one in real() if group == "real" else tape.read(group):
            lines = path.play(one, model)
            size += _keep(group, one, "events", expected.written(one, lines))
            events = Counter(line["type"] for line in lines if "at" in line)
            if group in expected.SEGMENTS:
                size += _keep(group, one, "segments", expected.written(one, segments.found(one, model)))
            print(f"  {len(one.packets)} packets, {events.total()} events")
            kinds += events
            number += 1
        (expected.FOLDER / group / expected.MACHINE).write_text(json.dumps(expected.machine(), indent=2) + "\n")
    by_type = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    print(f"{number} tapes, {kinds.total()} events ({by_type}), {size:,} bytes of expected lines")
    return 0


def _keep(group: str, one: tape.Tape, kind: str, text: str) -> int:
    """Write a file, and say whether it has changed."""
    file = expected.path_of(group, one, kind)
    before = file.read_text() if file.exists() else None
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    change = "new" if before is None else "as before" if before == text else "CHANGED"
    print(f"{digest} {group}/{file.name}: {change}")
    if before is not None and (first := expected.difference(before, text, exact=True)):
        print(first)
    return len(text)


if __name__ == "__main__":
    sys.exit(main())
