# Copyright 2026 ride_estimation contributors
"""The cab on its mounts built in MuJoCo, an independent multibody program, from the numbers of the vehicle file.

A mount axis is a spring tendon to a point a kilometre away on a base body so heavy that the cab does not move it; the
base bodies are driven by forces ``M a``. Nothing of the package's kinematics, assembly or integration is used.
"""

from __future__ import annotations

import mujoco
import numpy as np

FAR = 1.0e4  # m; turns the tendon direction by less than 1e-5 rad for 0.1 m of motion
HEAVY = 1.0e12  # kg, per base body
AXES = np.eye(3)


def cab_model(vehicle, static_force, step, sensors=()):
    """Return the compiled MuJoCo model of the single body ``cab`` with Kelvin-Voigt mounts.

    ``sensors`` of the vehicle file become MuJoCo accelerometers, on the cab or on the base of their mount, turned as stated.
    """
    body = vehicle.bodies["cab"]
    i = body.inertia
    inertia = " ".join(repr(float(v)) for v in (i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))
    bases, sites, tendons = [], [], []
    mounted = {name: [] for name in ("cab", *vehicle.mounts)}
    for s in sensors:
        origin = body.cg if s.body == "cab" else vehicle.mounts[s.mount].position
        place, turned = (
            " ".join(map(repr, v.tolist())) for v in (s.position - origin, s.rotation[:, :2].T.ravel())
        )
        mounted[s.mount or "cab"].append(f'<site name="{s.name}" pos="{place}" xyaxes="{turned}"/>')
    read = "".join(f'<accelerometer site="{s.name}"/>' for s in sensors)
    for number, (name_of_mount, mount) in enumerate(vehicle.mounts.items()):
        p = mount.position - body.cg
        joints = "".join(f'<joint type="slide" axis="{" ".join(map(str, a))}"/>' for a in AXES)
        far = "".join(
            f'<site name="far{number}{axis}" pos="{" ".join(repr(float(v)) for v in FAR * AXES[axis])}"/>' for axis in range(3)
        )
        place = " ".join(repr(float(v)) for v in p)
        bases.append(
            f'<body pos="{place}" gravcomp="1">{joints}<inertial pos="0 0 0" mass="{HEAVY}" diaginertia="1 1 1"/>{far}'
            f'{"".join(mounted[name_of_mount])}</body>'
        )
        sites.append(f'<site name="mount{number}" pos="{place}"/>')
        for axis, name in enumerate("xyz"):
            element = mount.elements[name]
            rest = float(FAR - static_force[number, axis] / element.stiffness)
            tendons.append(
                f'<spatial stiffness="{element.stiffness!r}" damping="{element.damping!r}" springlength="{rest!r}">'
                f'<site site="far{number}{axis}"/><site site="mount{number}"/></spatial>'
            )
    xml = f"""<mujoco><option timestep="{step}" integrator="RK4" gravity="0 0 {-vehicle.gravity}"/>
    <compiler balanceinertia="false" boundmass="0" boundinertia="0"/>
    <worldbody><body name="cab"><freejoint/>
    <inertial pos="0 0 0" mass="{body.mass.value}" fullinertia="{inertia}"/>{"".join(sites + mounted["cab"])}</body>
    {"".join(bases)}</worldbody>
    <tendon>{"".join(tendons)}</tendon><sensor>{read}</sensor></mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def eigenfrequencies(model):
    """Return the undamped natural frequencies [Hz] of the cab by MuJoCo's own forces, central differences."""
    undamped = model
    undamped.tendon_damping[:] = 0.0
    data = mujoco.MjData(undamped)
    mass = np.zeros((undamped.nv, undamped.nv))
    mujoco.mj_forward(undamped, data)
    mujoco.mj_fullM(undamped, data, mass)
    stiffness = np.zeros((6, 6))
    delta = 1e-6
    for column in range(6):
        forces = []
        for sign in (1.0, -1.0):
            mujoco.mj_resetData(undamped, data)
            change = np.zeros(undamped.nv)
            change[column] = sign * delta
            mujoco.mj_integratePos(undamped, data.qpos, change, 1.0)
            mujoco.mj_forward(undamped, data)
            forces.append((data.qfrc_passive - data.qfrc_bias)[:6].copy())
        stiffness[:, column] = -(forces[0] - forces[1]) / (2.0 * delta)
    values = np.linalg.eigvals(np.linalg.solve(mass[:6, :6], stiffness))
    return np.sort(np.sqrt(np.real(values)) / (2.0 * np.pi))


def drive(model, base_acceleration, cubic=None, start_rate=None, readings=None):
    """Run the cab on driven bases.

    Parameters
    ----------
    base_acceleration
        Held over each step, shape (N, M, 3) [m/s^2].
    cubic
        Cubic stiffness per mount and axis, shape (M, 3) [N/m^3].
    start_rate
        Initial (velocity, angular velocity in body axes), shape (6,).
    readings
        List that is given (readings of all sensors, angular velocity in body axes) of every step.

    Returns
    -------
    tuple
        Base displacement and velocity (N, M, 3), cab displacement (N, 3), rotation (N, 3, 3), acceleration (N, 6).
    """
    data = mujoco.MjData(model)
    samples, mounts, _ = base_acceleration.shape
    if start_rate is not None:
        data.qvel[:6] = start_rate
    sites = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"mount{i}") for i in range(mounts)]
    place = np.array([model.site_pos[s] for s in sites])

    def extra(_, d):
        for i, site in enumerate(sites):
            gap = d.site_xpos[site] - place[i] - d.qpos[7 + 3 * i : 10 + 3 * i]
            mujoco.mj_applyFT(model, d, -cubic[i] * gap**3, np.zeros(3), d.site_xpos[site], 1, d.qfrc_passive)

    if cubic is not None:
        mujoco.set_mjcb_passive(extra)
    try:
        base, base_rate = np.zeros((samples, mounts, 3)), np.zeros((samples, mounts, 3))
        cab, rotation, acceleration = np.zeros((samples, 3)), np.zeros((samples, 3, 3)), np.zeros((samples, 6))
        for n in range(samples):
            data.qfrc_applied[6:] = HEAVY * base_acceleration[n].reshape(-1)
            mujoco.mj_forward(model, data)
            base[n], base_rate[n] = data.qpos[7:].reshape(mounts, 3), data.qvel[6:].reshape(mounts, 3)
            cab[n], rotation[n], acceleration[n] = data.qpos[:3], data.xmat[1].reshape(3, 3), data.qacc[:6]
            if readings is not None:
                readings.append((data.sensordata.copy(), data.qvel[3:6].copy()))
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    return base, base_rate, cab, rotation, acceleration
