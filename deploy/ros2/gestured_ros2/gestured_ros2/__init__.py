"""A ROS 2 node that publishes the events of a gestured daemon."""
