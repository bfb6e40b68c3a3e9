"""Decodes a file of ROS 2 messages with the public package mcap-ros2-support: one line of JSON for each message, in the order of the file."""

import json
import sys

from mcap_ros2.reader import read_ros2_messages


def plain(value):
    """A message as dictionaries, lists, numbers and text."""
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, bytes):
        return list(value)
    return value


for message in read_ros2_messages(sys.argv[1]):
    row = {
        "topic": message.channel.topic,
        "type": message.schema.name,
        "log_time_ns": message.log_time_ns,
        "message": plain(message.ros_msg),
    }
    print(json.dumps(row, allow_nan=True))
