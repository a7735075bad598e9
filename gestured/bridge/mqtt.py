"""`gestured-bridge mqtt`: gesture events to an MQTT broker, with Home Assistant discovery.

    gestured/{host}/{sensor}/{type}    an event in JSON as on the socket, with the daemon's `instance`; never retained
    gestured/{host}/{sensor}/state     the state of the sensor, retained
    gestured/{host}/{sensor}/gates     its closed gates and arming, as JSON, retained
    gestured/{host}/{sensor}/gate/set  with --gates: `OFF` closes a gate of the sensor, `ON` opens it; never retained
    gestured/{host}/availability       `online` or `offline`, retained; `offline` also by last will

All with QoS 1, so that an event may come twice; its `instance`, `sensor` and `sequence` are then the same.

An event is of use only while it is fresh. One that is older than OLD_S when the broker can be reached is not sent, and
the broker keeps none longer for a subscriber. A gap in `sequence` shows how many were missed.
"""

import argparse
import threading
from pathlib import Path

from gestured.bridge.broker import PLAIN_PORT, TLS_PORT
from gestured.bridge.counts import Counts
from gestured.bridge.daemon import NOTICE_S, follow
from gestured.bridge.mqtt_session import Mqtt
from gestured.bridge.options import add_filters, add_metrics, need, subscriber
from gestured.client.program import Commands
from gestured.client.stop import on_stop
from gestured.client.values import sensor_name


def add(commands: Commands) -> None:
    """Add the bridge to the command line."""
    parser = commands.add_parser(
        "mqtt",
        help="events to an MQTT broker",
        description="Publish events under gestured/HOST/SENSOR/TYPE, with Home Assistant discovery.\n"
        "User and password are the variables MQTT_USER and MQTT_PASSWORD.",
        epilog="examples:\n  gestured-bridge mqtt --broker 192.168.7.2\n"
        "  gestured-bridge mqtt --broker broker.example --tls --gates /run/gestured/gates.sock",
    )
    text = f"the broker (port {PLAIN_PORT}, with TLS {TLS_PORT}, unless named)"
    parser.takes("--broker", "HOST[:PORT]", text, required=True)
    parser.takes("--host", "NAME", "name of this machine in topics (default: its hostname)")
    add_filters(parser)
    parser.add_argument("--tls", action="store_true", help="encrypt, and check the broker's certificate")
    parser.takes("--ca", "FILE", "certificates to trust instead of the system's (PEM)", type=Path)
    parser.takes("--cert", "FILE", "our own certificate and key (PEM)", type=Path)
    text = "discovery prefix of Home Assistant (default: homeassistant)"
    parser.takes("--discovery", "PREFIX", text, default="homeassistant")
    parser.add_argument("--no-discovery", action="store_true", help="publish nothing for Home Assistant")
    text = "the daemon's socket for bridges: have the broker close and open a gate (default: it can do nothing)"
    parser.takes("--gates", "PATH", text, type=Path)
    parser.takes("--gate", "NAME", "name of that gate (default: mqtt)", type=sensor_name, default="mqtt")
    add_metrics(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Mirror events until SIGTERM or Ctrl-C."""
    need("paho.mqtt.client", "paho-mqtt", "mqtt")
    counts = Counts("mqtt")
    bridge = Mqtt(args, counts)
    counts.serve(args.metrics)
    source = subscriber(args, NOTICE_S, counts.wrong)
    on_stop(bridge.stop)
    hears = threading.Thread(target=bridge.hear, args=(follow(source, counts),), name="daemon", daemon=True)
    hears.start()
    try:
        bridge.work()
    finally:
        source.close()
        hears.join()
    return 0
