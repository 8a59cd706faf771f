"""Motion and inertia of a chain of turning joints; arrays only.

A chain has n freedoms, one after the other: of each the turn (3, 3) and the offset (3,) from the frame before it, in whose axes they
stand; the axis (3,) of its own frame about which it turns; and mass, centre (3,) and inertia (3, 3) about the centre of the body that it
moves, in its own frame, which stands in the axis. Everything below stands in the axes of the base.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model="numpy")
def frames(turn, offset, axis, angle, rotation, origin, direction):
    """Fill each frame's axes as columns (n, 3, 3), its origin (n, 3) and the direction of its joint's axis (n, 3)."""
    own = np.empty((3, 3))
    for k in range(angle.size):
        for i in range(3):
            place = 0.0
            for j in range(3):
                before = rotation[k - 1, i, j] if k else (1.0 if i == j else 0.0)
                place += before * offset[k, j]
            origin[k, i] = place + (origin[k - 1, i] if k else 0.0)
        x, y, z = axis[k]
        c, s = math.cos(angle[k]), math.sin(angle[k])
        v = 1.0 - c
        own[0, 0], own[0, 1], own[0, 2] = c + v * x * x, v * x * y - s * z, v * x * z + s * y
        own[1, 0], own[1, 1], own[1, 2] = v * x * y + s * z, c + v * y * y, v * y * z - s * x
        own[2, 0], own[2, 1], own[2, 2] = v * x * z - s * y, v * y * z + s * x, c + v * z * z
        for i in range(3):
            for j in range(3):
                total = 0.0
                for a in range(3):
                    for b in range(3):
                        before = rotation[k - 1, i, a] if k else (1.0 if i == a else 0.0)
                        total += before * turn[k, a, b] * own[b, j]
                rotation[k, i, j] = total
        for i in range(3):
            direction[k, i] = rotation[k, i, 0] * x + rotation[k, i, 1] * y + rotation[k, i, 2] * z


@numba.njit(cache=True, error_model="numpy")
def jacobian(origin, direction, point, out):
    """Fill the motion (6, n) of a point and of its frame with each angle: translations, then rotations."""
    for k in range(origin.shape[0]):
        dx, dy, dz = point[0] - origin[k, 0], point[1] - origin[k, 1], point[2] - origin[k, 2]
        x, y, z = direction[k]
        out[0, k], out[1, k], out[2, k] = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
        out[3, k], out[4, k], out[5, k] = x, y, z


@numba.njit(cache=True, error_model="numpy")
def _turned_inertia(rotation, inertia, out):
    """out = R I R^T."""
    for i in range(3):
        for j in range(i + 1):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += rotation[i, a] * inertia[a, b] * rotation[j, b]
            out[i, j] = total
            out[j, i] = total


@numba.njit(cache=True, error_model="numpy")
def mass_matrix(rotation, origin, direction, mass, centre, inertia, out):
    """Fill the mass matrix (n, n) by composite bodies [featherstone2008].

    From the last body back, all that hangs on a joint is one body: its mass, its first moment and its inertia about the base's origin.
    """
    n = mass.size
    weight, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    own = np.empty((3, 3))
    place = np.empty(3)
    lever = np.empty((n, 3))
    for k in range(n):
        x, y, z = direction[k]
        px, py, pz = origin[k]
        # velocity at the base's origin when the joint turns at unit speed
        lever[k, 0], lever[k, 1], lever[k, 2] = py * z - pz * y, pz * x - px * z, px * y - py * x
    for k in range(n - 1, -1, -1):
        if mass[k] > 0.0:
            for i in range(3):
                place[i] = origin[k, i]
                for j in range(3):
                    place[i] += rotation[k, i, j] * centre[k, j]
            _turned_inertia(rotation[k], inertia[k], own)
            square = place[0] * place[0] + place[1] * place[1] + place[2] * place[2]
            weight += mass[k]
            for i in range(3):
                first[i] += mass[k] * place[i]
                for j in range(3):
                    second[i, j] += own[i, j] + mass[k] * ((square if i == j else 0.0) - place[i] * place[j])
        x, y, z = direction[k]
        vx, vy, vz = lever[k]
        # momentum of the composite body: linear, and angular about the base's origin
        lx = weight * vx + y * first[2] - z * first[1]
        ly = weight * vy + z * first[0] - x * first[2]
        lz = weight * vz + x * first[1] - y * first[0]
        hx = second[0, 0] * x + second[0, 1] * y + second[0, 2] * z + first[1] * vz - first[2] * vy
        hy = second[1, 0] * x + second[1, 1] * y + second[1, 2] * z + first[2] * vx - first[0] * vz
        hz = second[2, 0] * x + second[2, 1] * y + second[2, 2] * z + first[0] * vy - first[1] * vx
        for j in range(k + 1):
            entry = direction[j, 0] * hx + direction[j, 1] * hy + direction[j, 2] * hz
            entry += lever[j, 0] * lx + lever[j, 1] * ly + lever[j, 2] * lz
            out[k, j] = entry
            out[j, k] = entry


@numba.njit(cache=True, error_model="numpy")
def inverse_dynamics(rotation, origin, direction, mass, centre, inertia, rate, acceleration, gravity, out):
    """Fill the torques (n,) of a motion by recursive Newton-Euler equations [featherstone2008]: M q'' + c(q, q') + g(q).

    Parameters
    ----------
    rate, acceleration : (n,) of the angles
    gravity : (3,) acceleration of free fall
    """
    n = mass.size
    spin, turn, rise = np.zeros(3), np.zeros(3), np.empty(3)
    # a base that is pushed up instead of bodies that are pulled down
    rise[0], rise[1], rise[2] = -gravity[0], -gravity[1], -gravity[2]
    force, moment = np.zeros((n, 3)), np.zeros((n, 3))
    arm, own, body = np.zeros(3), np.empty((3, 3)), np.empty(3)
    for k in range(n):
        for i in range(3):
            arm[i] = origin[k, i] - (origin[k - 1, i] if k else 0.0)
        _carry(spin, turn, arm, rise)
        a = direction[k]
        r, s = rate[k], acceleration[k]
        cross_x, cross_y, cross_z = spin[1] * a[2] - spin[2] * a[1], spin[2] * a[0] - spin[0] * a[2], spin[0] * a[1] - spin[1] * a[0]
        turn[0] += s * a[0] + r * cross_x
        turn[1] += s * a[1] + r * cross_y
        turn[2] += s * a[2] + r * cross_z
        for i in range(3):
            spin[i] += r * a[i]
        if mass[k] > 0.0:
            for i in range(3):
                arm[i] = rotation[k, i, 0] * centre[k, 0] + rotation[k, i, 1] * centre[k, 1] + rotation[k, i, 2] * centre[k, 2]
                body[i] = rise[i]
            _carry(spin, turn, arm, body)
            _turned_inertia(rotation[k], inertia[k], own)
            hx = own[0, 0] * spin[0] + own[0, 1] * spin[1] + own[0, 2] * spin[2]
            hy = own[1, 0] * spin[0] + own[1, 1] * spin[1] + own[1, 2] * spin[2]
            hz = own[2, 0] * spin[0] + own[2, 1] * spin[1] + own[2, 2] * spin[2]
            fx, fy, fz = mass[k] * body[0], mass[k] * body[1], mass[k] * body[2]
            force[k, 0], force[k, 1], force[k, 2] = fx, fy, fz
            moment[k, 0] = spin[1] * hz - spin[2] * hy + arm[1] * fz - arm[2] * fy
            moment[k, 1] = spin[2] * hx - spin[0] * hz + arm[2] * fx - arm[0] * fz
            moment[k, 2] = spin[0] * hy - spin[1] * hx + arm[0] * fy - arm[1] * fx
            for i in range(3):
                moment[k, i] += own[i, 0] * turn[0] + own[i, 1] * turn[1] + own[i, 2] * turn[2]
    for k in range(n - 1, -1, -1):
        out[k] = direction[k, 0] * moment[k, 0] + direction[k, 1] * moment[k, 1] + direction[k, 2] * moment[k, 2]
        if k:
            for i in range(3):
                arm[i] = origin[k, i] - origin[k - 1, i]
                force[k - 1, i] += force[k, i]
            moment[k - 1, 0] += moment[k, 0] + arm[1] * force[k, 2] - arm[2] * force[k, 1]
            moment[k - 1, 1] += moment[k, 1] + arm[2] * force[k, 0] - arm[0] * force[k, 2]
            moment[k - 1, 2] += moment[k, 2] + arm[0] * force[k, 1] - arm[1] * force[k, 0]


@numba.njit(cache=True, error_model="numpy")
def _carry(spin, turn, arm, rise):
    """Acceleration of a point of a body at `arm` from one whose acceleration is `rise`, in place."""
    tx = spin[1] * arm[2] - spin[2] * arm[1]
    ty = spin[2] * arm[0] - spin[0] * arm[2]
    tz = spin[0] * arm[1] - spin[1] * arm[0]
    rise[0] += turn[1] * arm[2] - turn[2] * arm[1] + spin[1] * tz - spin[2] * ty
    rise[1] += turn[2] * arm[0] - turn[0] * arm[2] + spin[2] * tx - spin[0] * tz
    rise[2] += turn[0] * arm[1] - turn[1] * arm[0] + spin[0] * ty - spin[1] * tx


@numba.njit(cache=True, error_model="numpy")
def solve_symmetric(matrix, right):
    """Solve a positive definite system in place, right side (n,): L L^T, the lower triangle is overwritten."""
    n = right.size
    for j in range(n):
        for k in range(j):
            share = matrix[j, k]
            for i in range(j, n):
                matrix[i, j] -= share * matrix[i, k]
        root = 1.0 / math.sqrt(matrix[j, j])
        for i in range(j, n):
            matrix[i, j] *= root
    for j in range(n):
        for k in range(j):
            right[j] -= matrix[j, k] * right[k]
        right[j] /= matrix[j, j]
    for j in range(n - 1, -1, -1):
        for k in range(j + 1, n):
            right[j] -= matrix[k, j] * right[k]
        right[j] /= matrix[j, j]


@numba.njit(cache=True, error_model="numpy")
def point_torques(turn, offset, axis, angles, rate, acceleration, gravity, link, place, out):
    """Fill the torques (p, n, t) that points of unit mass ask of the joints along a motion.

    Parameters
    ----------
    turn, offset, axis : of a chain
    angles, rate, acceleration : (t, n)
    gravity : (3,)
    link : (p,) frame that each point belongs to; place : (p, 3) in it
    """
    n = axis.shape[0]
    rotation, origin, direction = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    mass, centre, inertia, torque = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3)), np.empty(n)
    for t in range(angles.shape[0]):
        frames(turn, offset, axis, angles[t], rotation, origin, direction)
        for p in range(link.size):
            mass[link[p]] = 1.0
            for i in range(3):
                centre[link[p], i] = place[p, i]
            inverse_dynamics(rotation, origin, direction, mass, centre, inertia, rate[t], acceleration[t], gravity, torque)
            mass[link[p]] = 0.0
            for k in range(n):
                out[p, k, t] = torque[k]


@numba.njit(cache=True, error_model="numpy")
def march(chain, play, gravity, point, fed, force, held, rate, step, out):
    """March an arm through time by the average acceleration [newmark1959]; return the instants done, fewer where one has no solution.

    M(q) q'' + c(q, q') + g(q) = J^T F + fed - k (q - held, less the play) - d (q' - rate), solved at each instant by Newton's steps with
    the tangent of inertia, damping and springs.

    Parameters
    ----------
    chain : its arrays by name; play : (n,) half of each
    gravity : (3,); point : (3,) of the tool's tip in the last frame
    fed : (t, n) torques of the control; force : (t, 3) on the tip, in the base's axes
    held, rate : (t, n) angles that the drives hold, and their rates
    step : of time
    out : (t, n) angles; the first row is given, at rest
    """
    n = play.size
    rotation, origin, direction = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    tangent, torque, gap, tip = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(3)
    angle, speed, gain = out[0].copy(), np.zeros(n), np.zeros(n)
    last, last_speed, last_gain = np.empty(n), np.empty(n), np.empty(n)
    inertial, viscous = 4.0 / (step * step), 2.0 / step
    for t in range(1, out.shape[0]):
        for i in range(n):
            last[i], last_speed[i], last_gain[i] = angle[i], speed[i], gain[i]
            angle[i] += step * speed[i] + 0.5 * step * step * gain[i]
        settled = False
        for _ in range(40):
            for i in range(n):
                gain[i] = inertial * (angle[i] - last[i] - step * last_speed[i]) - last_gain[i]
                speed[i] = last_speed[i] + 0.5 * step * (last_gain[i] + gain[i])
            if settled:
                break
            frames(chain.turn, chain.offset, chain.axis, angle, rotation, origin, direction)
            mass_matrix(rotation, origin, direction, chain.mass, chain.centre, chain.inertia, tangent)
            inverse_dynamics(rotation, origin, direction, chain.mass, chain.centre, chain.inertia, speed, gain, gravity, torque)
            for i in range(3):
                tip[i] = origin[n - 1, i]
                for j in range(3):
                    tip[i] += rotation[n - 1, i, j] * point[j]
            fx, fy, fz = force[t]
            for k in range(n):
                x, y, z = tip[0] - origin[k, 0], tip[1] - origin[k, 1], tip[2] - origin[k, 2]
                own = direction[k, 0] * (y * fz - z * fy) + direction[k, 1] * (z * fx - x * fz) + direction[k, 2] * (x * fy - y * fx)
                twist = angle[k] - held[t, k]
                felt = max(abs(twist) - play[k], 0.0) * (1.0 if twist > 0.0 else -1.0)
                springs = chain.stiffness[k] * felt + chain.damping[k] * (speed[k] - rate[t, k])
                gap[k] = own + fed[t, k] - springs - torque[k]
                for j in range(n):
                    tangent[k, j] *= inertial
                tangent[k, k] += viscous * chain.damping[k] + (chain.stiffness[k] if felt != 0.0 else 0.0)
            solve_symmetric(tangent, gap)
            settled = True
            for k in range(n):
                angle[k] += gap[k]
                # what is no number has not settled
                settled = settled and abs(gap[k]) < 1e-12
        if not settled:
            return t
        for k in range(n):
            out[t, k] = angle[k]
    return out.shape[0]
