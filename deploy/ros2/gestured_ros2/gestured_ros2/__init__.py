"""Gestures of a gestured daemon as ROS 2 messages."""
