"""A robot that runs ROS 1, as a process of its own: people, move_base, speech; it prints what it gets.

Run by the Python of the system. Standard input: a command a line, "abort", "hang", "succeed" or "quit".
"""

import json
import sys
import threading
import time

import rospy
from actionlib import SimpleActionServer
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseResult
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolResponse
from visualization_msgs.msg import Marker, MarkerArray


def emit(**event):
    sys.stdout.write(json.dumps(event) + "\n")  # in one piece: several threads write
    sys.stdout.flush()


rospy.init_node("robot", disable_signals=True)
people = rospy.Publisher("/people", MarkerArray, queue_size=10)
pose = rospy.Publisher("/pose", PoseStamped, queue_size=10)
speech = rospy.Publisher("/speech", String, queue_size=10)
echo = rospy.Publisher("/echo", String, queue_size=10)
position, mode, begin = [0.0, 0.0], ["succeed"], time.time()


def publish():
    while not rospy.is_shutdown():
        message, stamp = MarkerArray(), rospy.Time.now()
        for number, x in ((1, max(1.0, 6.0 - (time.time() - begin))), (2, 3.0)):
            marker = Marker(id=number)
            marker.header.frame_id, marker.header.stamp = "map", stamp
            marker.pose.position.x, marker.pose.position.y = x, 0.2 * number
            message.markers.append(marker)
        people.publish(message)
        here = PoseStamped()
        here.header.frame_id, here.header.stamp = "map", stamp
        here.pose.position.x, here.pose.position.y, here.pose.orientation.w = *position, 1.0
        pose.publish(here)
        time.sleep(0.1)


def answer():
    threading.Timer(0.2, lambda: speech.publish(String("yes please"))).start()


def hear(message):
    emit(event="say", text=message.data)
    answer()


def navigate(goal):
    emit(event="goal", frame=goal.target_pose.header.frame_id, x=goal.target_pose.pose.position.x)
    if mode[0] == "abort":
        server.set_aborted(MoveBaseResult(), "blocked")
        return
    end = time.time() + (3600 if mode[0] == "hang" else 0.1)
    while time.time() < end:
        if server.is_preempt_requested():
            emit(event="cancel")
            server.set_preempted()
            return
        time.sleep(0.01)
    position[:] = goal.target_pose.pose.position.x, goal.target_pose.pose.position.y
    server.set_succeeded()
    answer()


def move(message):
    emit(event="twist", linear=message.linear.x, angular=message.angular.z)


def set_bool(request):
    emit(event="service", data=request.data)
    answer()
    return SetBoolResponse(request.data, "set")


server = SimpleActionServer("/move_base", MoveBaseAction, navigate, auto_start=False)
rospy.Subscriber("/cmd_vel", Twist, move)
rospy.Subscriber("/say", String, hear)
rospy.Subscriber("/ping", String, echo.publish)
rospy.Subscriber("/belief", String, lambda m: emit(event="belief", **json.loads(m.data)))
rospy.Service("/set", SetBool, set_bool)
server.start()
threading.Thread(target=publish, daemon=True).start()
emit(event="ready")
for line in sys.stdin:
    if line.strip() == "quit":
        break
    mode[0] = line.strip()
