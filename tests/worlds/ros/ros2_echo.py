"""A node that publishes on /echo what it receives on /ping; a process of its own, for the round trip.

One thread: rclpy's executor of several threads spins without rest after some messages (a busy core, replies
after 50 ms), which would be measured in place of the connection.
"""

import json

import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("echo")
echo = node.create_publisher(String, "/echo", 10)
node.create_subscription(String, "/ping", echo.publish, 10)
print(json.dumps({"event": "ready"}), flush=True)
rclpy.spin(node)
