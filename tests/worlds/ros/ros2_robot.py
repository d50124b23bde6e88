"""A robot that runs ROS 2, as a process of its own: people, an action server, speech; it prints what it gets.

Run by the interpreter of an environment with rclpy. Standard input: one command a line, e.g. "quit".
The order of a Fibonacci goal selects what happens: 0 is refused, 1 aborted, 2 runs until it is cancelled,
and others take a tenth of a second.
"""

import json
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import Twist
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import SetBool
from test_msgs.action import Fibonacci
from visualization_msgs.msg import Marker, MarkerArray


def emit(**event):
    sys.stdout.write(json.dumps(event) + "\n")  # in one piece: several threads write
    sys.stdout.flush()


rclpy.init()
node = rclpy.create_node("robot")
group = ReentrantCallbackGroup()
people = node.create_publisher(MarkerArray, "/people", 10)
speech = node.create_publisher(String, "/speech", 10)
begin = time.time()


def publish_people():
    now = time.time()
    walked = now - begin
    message = MarkerArray()
    for number, x in ((1, max(1.0, 6.0 - walked)), (2, 3.0)):
        marker = Marker()
        marker.header.frame_id = "map"
        marker.header.stamp.sec = int(now)
        marker.header.stamp.nanosec = int((now % 1) * 1e9)
        marker.id = number
        marker.pose.position.x = x
        marker.pose.position.y = 0.2 * number
        message.markers.append(marker)
    people.publish(message)


def take_goal(goal):
    emit(event="goal", order=goal.order)
    return GoalResponse.REJECT if goal.order == 0 else GoalResponse.ACCEPT


def take_cancel(_):
    emit(event="cancel")
    return CancelResponse.ACCEPT


def execute(handle):
    order = handle.request.order
    result = Fibonacci.Result()
    if order == 1:
        handle.abort()
        return result
    end = time.time() + (3600 if order == 2 else 0.1)
    while time.time() < end:
        if handle.is_cancel_requested:
            handle.canceled()
            return result
        time.sleep(0.01)
    result.sequence = list(range(order))
    handle.succeed()
    answer()
    return result


def answer():
    threading.Timer(0.2, lambda: speech.publish(String(data="yes please"))).start()


def hear(message):
    emit(event="say", text=message.data)
    answer()


def set_bool(request, response):
    emit(event="service", data=request.data)
    response.success, response.message = request.data, "set"
    return response


def move(message):
    emit(event="twist", linear=message.linear.x, angular=message.angular.z)


server = ActionServer(
    node,
    Fibonacci,
    "/move",
    execute,
    goal_callback=take_goal,
    cancel_callback=take_cancel,
    callback_group=group,
)
node.create_subscription(Twist, "/cmd_vel", move, 10)
node.create_subscription(String, "/say", hear, 10)
node.create_subscription(String, "/belief", lambda m: emit(event="belief", **json.loads(m.data)), 10)
node.create_service(SetBool, "/set", set_bool)
node.create_timer(0.1, publish_people)
executor = MultiThreadedExecutor(4)
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
emit(event="ready")
for line in sys.stdin:
    if line.strip() == "quit":
        break
