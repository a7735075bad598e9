"""gestured-bridge: events to MQTT and Zenoh, frames from Zenoh and serial lines; each in a process of its own."""
