"""What Pinocchio says of arms: one JSON per line in, the drives' torques out."""

import json
import sys

import numpy as np
import pinocchio as pin


def inertia(body, frame_at):
    ixx, iyy, izz, ixy, ixz, iyz = body["inertia"]
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    return pin.Inertia(body["mass"], np.array(body["centre"]) - frame_at, tensor)


for line in sys.stdin:
    case = json.loads(line)
    model = pin.Model()
    model.gravity.linear = np.array(case["gravity"])
    parent, at = 0, np.zeros(3)
    for joint in case["joints"]:
        axis, point = np.array(joint["axis"]), np.array(joint["point"])
        kind = pin.JointModelPrismaticUnaligned if joint["slides"] else pin.JointModelRevoluteUnaligned
        placement = pin.SE3(np.eye(3), point - at)
        parent, at = model.addJoint(parent, kind(axis), placement, joint["name"]), point
        model.appendBodyToJoint(parent, inertia(joint, at), pin.SE3.Identity())
    model.appendBodyToJoint(parent, inertia(case["tool"], at), pin.SE3.Identity())
    data = model.createData()
    q, v, a = (np.array(case[key]) for key in ("q", "velocity", "acceleration"))
    force, moment, tcp = (np.array(case[key]) for key in ("force", "moment", "tcp"))
    pin.framesForwardKinematics(model, data, q)
    jacobian = pin.computeJointJacobians(model, data, q)
    # The last joint's Jacobian in base axes, of the point where the tool is now.
    last = pin.getJointJacobian(model, data, parent, pin.LOCAL_WORLD_ALIGNED)
    lever = data.oMi[parent].rotation @ (tcp - at)
    linear = last[:3] - np.cross(lever, last[3:], axisb=0, axisc=0)
    wrench = linear.T @ force + last[3:].T @ moment
    print(json.dumps(list(pin.rnea(model, data, q, v, a) - wrench)))
