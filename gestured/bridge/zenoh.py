"""`gestured-bridge zenoh`: gesture events to Zenoh, and with --frames a remote sensor's frames to the daemon.

gestured/{site}/{sensor}/{type}     an event in JSON as on the socket, with the daemon's `instance`
gestured/{site}/alive               liveliness token of the daemon
gestured/{site}/{sensor}/alive      liveliness token of a sensor that is heard
gestured/{site}/hello               answers a get with the daemon's hello; {sensor}/gesture with its last gesture
gestured/{site}/{sensor}/frames     in: OSC packets as over UDP, with counter and time; of this sensor alone

With --ros2 the events are topics of ROS 2 instead, in the form of rmw_zenoh: see `zenoh_ros.py`.
"""

import argparse
import os
from pathlib import Path

from gestured.bridge.counts import Counts
from gestured.bridge.daemon import NOTICE_S, follow
from gestured.bridge.options import add_destination, add_filters, add_metrics, need, subscriber
from gestured.bridge.zenoh_ros import Ros
from gestured.bridge.zenoh_session import ROUTER, Zenoh
from gestured.client.program import Commands
from gestured.client.stop import on_stop
from gestured.client.values import sensor_name

LAST_S = 1.0  # the longest wait for a router at the end, while the session opens or closes


def add(commands: Commands) -> None:
    """Add the bridge to the command line."""
    parser = commands.add_parser(
        "zenoh",
        help="events to Zenoh, or to nodes of ROS 2 that use it; frames from Zenoh",
        description="Publish events under gestured/SITE/SENSOR/TYPE, with liveliness tokens for daemon and sensors.",
        epilog="examples:\n  gestured-bridge zenoh --connect tcp/192.168.7.2:7447 --site car7\n"
        "  gestured-bridge zenoh --frames --to 127.0.0.1:9000\n"
        "  ROS_DOMAIN_ID=7 gestured-bridge zenoh --ros2",
    )
    text = f"a router or peer to call; may be repeated (default: {ROUTER})"
    parser.takes("--connect", "ENDPOINT", text, action="append")
    text = "Zenoh's own configuration (JSON5): certificates, users, where peers may call us"
    parser.takes("--config", "FILE", text, type=Path)
    parser.takes("--site", "NAME", "name of this place in keys (default: the hostname)", type=sensor_name)
    add_filters(parser)
    either = parser.add_mutually_exclusive_group()
    either.add_argument("--frames", action="store_true", help="also take frames from Zenoh to the daemon")
    text = "instead of keys of Zenoh's own, topics of ROS 2 for nodes with rmw_zenoh, in the domain that the variable "
    text += "ROS_DOMAIN_ID names (default: 0); --site is the namespace (default: none)"
    either.add_argument("--ros2", action="store_true", help=text)
    add_destination(parser)
    add_metrics(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Mirror events until SIGTERM or Ctrl-C."""
    need("zenoh", "eclipse-zenoh", "zenoh")
    counts = Counts("zenoh")
    bridge = Ros(args, counts) if args.ros2 else Zenoh(args, counts)
    source = subscriber(args, NOTICE_S, counts.wrong)
    on_stop(source.close)
    try:
        counts.serve(args.metrics)
        bridge.begin()
        for line in follow(source, counts):
            bridge.take(line)
    except BaseException:
        bridge.close()
        raise
    finally:
        source.close()
    if not bridge.close(LAST_S):
        # The waiting thread would abort the process if it returned to Python while the interpreter ends.
        os._exit(0)
    return 0
