// What Pinocchio takes for forward kinematics, the tool's Jacobian and gravity of one arm: the other half of `cargo xtask peers`.
//
// Reads the arm and its poses as `beside` tells them, then orders, one a line: `look` (TCP and gravity torques of each pose, for the two to be
// held against each other), `batch N` (time of one of N, ns). Joints along a base axis are Pinocchio's own kinds for that, its fastest.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <pinocchio/multibody.hpp>
#include <string>
#include <vector>

namespace pin = pinocchio;
using Vector3 = Eigen::Vector3d;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

static Vector3 vector() {
    Vector3 v;
    std::cin >> v[0] >> v[1] >> v[2];
    return v;
}

static pin::JointModel along(const Vector3& axis) {
    if (axis == Vector3::UnitX()) return pin::JointModelRX();
    if (axis == Vector3::UnitY()) return pin::JointModelRY();
    if (axis == Vector3::UnitZ()) return pin::JointModelRZ();
    return pin::JointModelRevoluteUnaligned(axis);
}

static pin::Inertia point_mass(double mass, const Vector3& centre) {
    return pin::Inertia(mass, centre, Eigen::Matrix3d::Zero());
}

int main() {
    pin::Model model;
    std::size_t joints = 0, poses = 0;
    std::cin >> joints;
    Vector3 carried = Vector3::Zero();
    pin::JointIndex last = 0;
    for (std::size_t i = 0; i < joints; ++i) {
        const Vector3 axis = vector(), point = vector();
        double mass = 0.0;
        std::cin >> mass;
        const Vector3 centre = vector();
        const pin::SE3 placed(Eigen::Matrix3d::Identity(), point - carried);
        last = model.addJoint(last, along(axis), placed, std::to_string(i + 1));
        model.appendBodyToJoint(last, point_mass(mass, centre - point));
        carried = point;
    }
    const Vector3 tcp = vector();
    double tool_mass = 0.0;
    std::cin >> tool_mass;
    model.appendBodyToJoint(last, point_mass(tool_mass, vector() - carried));
    const pin::SE3 tool(Eigen::Matrix3d::Identity(), tcp - carried);
    const auto frame = model.addFrame(pin::Frame("tool", last, tool, pin::OP_FRAME));
    model.gravity.linear(vector());
    std::cin >> poses;
    std::vector<Eigen::VectorXd> q(poses, Eigen::VectorXd(joints));
    for (auto& pose : q)
        for (std::size_t i = 0; i < joints; ++i) std::cin >> pose[i];

    pin::Data data(model);
    Jacobian jacobian = Jacobian::Zero(6, joints);
    const auto once = [&](const Eigen::VectorXd& pose) {
        pin::computeJointJacobians(model, data, pose);  // forward kinematics on the way
        pin::getFrameJacobian(model, data, frame, pin::LOCAL_WORLD_ALIGNED, jacobian);
        pin::updateFramePlacement(model, data, frame);
        pin::computeGeneralizedGravity(model, data, pose);
        asm volatile("" : : "r"(jacobian.data()), "r"(data.g.data()) : "memory");
    };
    std::string order;
    while (std::cin >> order) {
        if (order == "look") {
            for (const auto& pose : q) {
                once(pose);
                const Vector3 at = data.oMf[frame].translation();
                std::printf("%.17g %.17g %.17g", at[0], at[1], at[2]);
                // What gravity exerts is what the drives hold against, the other way round.
                for (std::size_t i = 0; i < joints; ++i) std::printf(" %.17g", -data.g[i]);
                std::printf("\n");
            }
        } else {
            std::size_t times = 0;
            std::cin >> times;
            const auto start = std::chrono::steady_clock::now();
            for (std::size_t k = 0; k < times; ++k) once(q[k % q.size()]);
            const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - start;
            std::printf("%.3f\n", took.count() / static_cast<double>(times));
        }
        std::fflush(stdout);
    }
}
