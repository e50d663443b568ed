# Copyright 2026 ride_estimation contributors
"""``ride-estimation identify`` end to end: files in, identification.json, element.yaml and report.html out."""

import json

import numpy as np
import pytest
import yaml

from ride_estimation.cli.main import main
from ride_estimation.elements.registry import element_from_mapping

H = 2e-3


def motion(seed, n=4000):
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(n, H)
    x = np.fft.irfft((f > 0.3) * (f < 8.0) * np.exp(2j * np.pi * rng.random(f.size)), n)
    return np.arange(n) * H, 2e-3 * x / np.std(x)


def force(t, x, seed):
    m, out, v = 0.0, np.empty(x.size), np.gradient(x, t)
    for i, step in enumerate(np.diff(x, prepend=x[0])):
        m = m * np.exp(-30 * H) + 6e4 * step * (1 - np.exp(-30 * H)) / (30 * H)
        out[i] = m
    return 1e5 * x + 100 * v + out + 2 * np.random.default_rng(seed).standard_normal(x.size)


def csv(path, seed, header="time_s,displacement_mm,force_kn", scale=(1, 1e3, 1e-3)):
    t, x = motion(seed)
    columns = np.column_stack([t * scale[0], x * scale[1], force(t, x, seed) * scale[2]])
    np.savetxt(path, columns, delimiter=",", header=header, comments="")
    return str(path)


def read(out):
    return json.loads((out / "identification.json").read_text(encoding="utf-8"))


def test_time_domain_route_writes_all_files(tmp_path, capsys):
    out = tmp_path / "out"
    code = main(
        [
            "identify",
            csv(tmp_path / "a.csv", 1),
            "--validate",
            csv(tmp_path / "b.csv", 2),
            "--model",
            "maxwell",
            "--out",
            str(out),
        ]
    )
    assert code == 0
    found = read(out)
    values = {p["name"]: (p["value"], p["std"], p["unit"]) for p in found["parameters"]}
    assert values["stiffness"][0] == pytest.approx(1e5, rel=0.02)
    assert values["cell_1_stiffness"][2] == "N/m"
    assert all(std > 0 for _, std, _ in values.values())
    assert set(found["validation"][0]) == {"run", "nrmse_std", "nrmse_max", "nrmse_range"}
    assert found["validation"][0]["run"] == "b.csv" and found["validation"][0]["nrmse_std"] < 0.05
    assert [r["model"] for r in found["ladder"]] == ["linear_spring", "kelvin_voigt", "maxwell"]
    assert found["ladder"][-1]["gain"] is not None and found["identifiability"]["null_direction"]
    assert len(found["correlation"]) == 3
    element = element_from_mapping(yaml.safe_load((out / "element.yaml").read_text(encoding="utf-8")))
    assert abs(element.dynamic_stiffness(2 * np.pi * 30, 1e-3)) == pytest.approx(1.6e5, rel=0.1)
    assert found["seen_in_data"]["largest_deflection_m"] > 0.0
    assert found["seen_in_data"]["lowest_preload_n"] <= found["seen_in_data"]["highest_preload_n"]
    report = (out / "report.html").read_text(encoding="utf-8")
    assert report.count('<figure class="chart">') == 3 and "http:" not in report and "https:" not in report
    assert "maxwell" in capsys.readouterr().out


def test_the_element_file_goes_into_a_vehicle_file(tmp_path):
    from pathlib import Path

    from ride_estimation.io.vehicle_file import load_vehicle

    out = tmp_path / "out"
    assert main(["identify", csv(tmp_path / "a.csv", 1), "--model", "modified_berg", "--out", str(out)]) == 0
    element = yaml.safe_load((out / "element.yaml").read_text(encoding="utf-8"))
    source = Path(__file__).parents[2] / "config" / "vehicles" / "truck_cab.yaml"
    document = yaml.safe_load(source.read_text(encoding="utf-8"))
    mount = next(iter(document["mounts"].values())) if isinstance(document["mounts"], dict) else document["mounts"][0]
    holder = mount if "z" in mount else mount["axes"] if "axes" in mount else mount["element"]
    holder["z"] = element
    path = tmp_path / "vehicle.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    vehicle = load_vehicle(path)
    assert element["kind"] in repr(vehicle.mounts) or any(
        "Berg" in repr(m) or "Sum" in repr(m) for m in np.atleast_1d(vehicle.mounts)
    )


def test_frequency_route_from_a_table(tmp_path, capsys):
    w, a = (v.ravel() for v in np.meshgrid(2 * np.pi * np.geomspace(0.1, 40, 8), [1e-4, 1e-3]))
    k = 1e5 + 6e4 * 1j * w / (1j * w + 30)
    table = np.column_stack([w / (2 * np.pi), 1e3 * a, np.abs(k) / 1e3, np.pi * a**2 * k.imag * 1e3])
    path = tmp_path / "dma.csv"
    np.savetxt(path, table, delimiter=",", header="frequency_hz,amplitude_mm,stiffness_n_per_mm,loss_energy_n_mm", comments="")
    out = tmp_path / "out"
    code = main(["identify", str(path), "--method", "frequency", "--validate", csv(tmp_path / "b.csv", 2), "--out", str(out)])
    assert code == 0
    found = read(out)
    assert found["model"] == "maxwell"
    values = {p["name"]: p["value"] for p in found["parameters"]}
    assert values == pytest.approx({"stiffness": 1e5, "cell_1_stiffness": 6e4, "cell_1_damping": 2e3}, rel=1e-4)
    assert found["validation"][0]["nrmse_std"] < 0.1
    assert "16 operating points" in capsys.readouterr().out
    printed = tmp_path / "printed"
    assert (
        main(["identify", str(path), "--method", "frequency", "--model", "maxwell", "--norm", "printed", "--out", str(printed)])
        == 0
    )
    assert read(printed)["method"] == "frequency domain, printed"
    # a model that was asked for is the answer, also where another one fits better
    asked = tmp_path / "asked"
    assert main(["identify", str(path), "--method", "frequency", "--model", "kelvin_voigt", "--out", str(asked)]) == 0
    assert read(asked)["model"] == "kelvin_voigt"
    assert yaml.safe_load((asked / "element.yaml").read_text(encoding="utf-8"))["kind"] == "kelvin_voigt"


def test_too_few_operating_points_for_the_model_asked_for_are_refused(tmp_path, capsys):
    path = tmp_path / "dma.csv"
    path.write_text("frequency_hz,amplitude_mm,stiffness_n_per_mm,loss_energy_n_mm\n1,1,100,30\n10,0.1,120,0.4\n")
    assert main(["identify", str(path), "--method", "frequency", "--model", "modified_berg", "--out", str(tmp_path / "out")]) == 2
    assert "2 operating points are too few for the 8 parameters of modified_berg" in capsys.readouterr().err


def test_frequency_route_from_records_without_harmonic_tests(tmp_path, capsys):
    code = main(["identify", csv(tmp_path / "a.csv", 1), "--method", "frequency", "--out", str(tmp_path / "out")])
    assert code == 2
    assert "no steady harmonic test was found" in capsys.readouterr().err


def test_oscillator_route(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(6000)
    y = np.zeros(6000)
    for k in range(2, 6000):
        y[k] = 1.4 * y[k - 1] - 0.9 * y[k - 2] + 0.1 * u[k - 1] - 0.05 * y[k - 1] ** 3
    path = tmp_path / "o.csv"
    np.savetxt(path, np.column_stack([u, y]), delimiter=",", header="drive,answer", comments="")
    out = tmp_path / "out"
    out.mkdir()
    (out / "element.yaml").write_text("kind: kelvin_voigt\n")  # of an earlier call: it is not that of the new results
    assert main(["identify", str(path), "--oscillator", "drive,answer", "--rate", "500", "--out", str(out)]) == 0
    found = read(out)
    assert found["model"] == "cubic_spring"
    assert found["physical"]["cubic"] == pytest.approx(0.5, rel=1e-3)
    assert not (out / "element.yaml").exists()


def bench_bag(folder, t, x, f, jitter=0.0, lost=()):
    """Write displacement and force of one mount with header stamps that jitter and samples that are lost."""
    rosbags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    rng = np.random.default_rng(9)
    kind = {"JointState": "sensor_msgs/msg/JointState", "WrenchStamped": "geometry_msgs/msg/WrenchStamped"}
    with rosbags.Writer(folder, version=9) as writer:
        way = writer.add_connection("/mounts/displacement", kind["JointState"], typestore=store)
        load = writer.add_connection("/mounts/rear_left/force_measured", kind["WrenchStamped"], typestore=store)
        vector, empty = types["geometry_msgs/msg/Vector3"], np.zeros(0)
        for i, s in enumerate(t):
            # either channel is sampled when its stamp says
            stamps = [1_700_000_000_000_000_000 + round((s + jitter * H * rng.uniform(-1, 1)) * 1e9) for _ in range(2)]
            d, p = (np.interp((stamp - 1_700_000_000_000_000_000) * 1e-9, t, v) for stamp, v in zip(stamps, (x, f)))
            heads = [
                types["std_msgs/msg/Header"](
                    stamp=types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="cab"
                )
                for stamp in stamps
            ]
            joint = types[kind["JointState"]](
                header=heads[0], name=["rear_left_z", "rear_right_z"], position=np.array([d, 0.0]), velocity=empty, effort=empty
            )
            # the wrench is the force on the cab BY the mount
            wrench = types["geometry_msgs/msg/Wrench"](force=vector(0.0, 0.0, -p), torque=vector(0.0, 0.0, 0.0))
            forced = types[kind["WrenchStamped"]](header=heads[1], wrench=wrench)
            if i not in lost:
                writer.write(way, stamps[0], store.serialize_cdr(joint, kind["JointState"]))
            writer.write(load, stamps[1], store.serialize_cdr(forced, kind["WrenchStamped"]))
    return folder


@pytest.mark.parametrize(("jitter", "lost"), [(0.0, ()), (0.2, (700, 1900))])
def test_bag_route(tmp_path, jitter, lost):
    t, x = motion(3)
    bench_bag(tmp_path / "bag", t, x, force(t, x, 3), jitter, lost)
    out = tmp_path / "out"
    assert (
        main(["identify", str(tmp_path / "bag"), "--mount", "rear_left", "--axis", "z", "--model", "maxwell", "--out", str(out)])
        == 0
    )
    values = {p["name"]: p["value"] for p in read(out)["parameters"]}
    assert values["stiffness"] == pytest.approx(1e5, rel=0.02)


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        (lambda t, x, f: (t[:100], x[:100], f[:100]), [], "too short"),
        (lambda t, x, f: (t[::-1], x, f), [], "time does not increase"),
        (lambda t, x, f: (t + 0.05 * (np.arange(t.size) // 100), x, f), [], "samples without a gap"),
        (lambda t, x, f: (t, 0 * x, f), [], "displacement is constant"),
        (lambda t, x, f: (t, np.where(t == t[5], np.nan, x), f), [], "not finite"),
        (lambda t, x, f: (t, x, f), ["--displacement-unit", "m"], "given as metres"),
        (lambda t, x, f: (t, x, f), ["--force", "weight"], "no column 'weight'"),
        (lambda t, x, f: (t, x, f), ["--force", "displacement_mm", "--force-unit", "kN"], "is a displacement by the unit"),
        (lambda t, x, f: (t, x, -f), [], "pass --sign opposed"),
        (lambda t, x, f: (t, x, 0 * f + 3), [], "force is constant"),
        (lambda t, x, f: (t, x, f), ["--force-unit", "furlong"], "unit 'furlong' of column 'force_kn' is unknown"),
        (lambda t, x, f: (t, x, f), ["--model", "magic"], "model 'magic' is unknown"),
        (lambda t, x, f: (t, x, f), ["--model", "jounce_bumper"], "only pushes"),
        (lambda t, x, f: (t, x, f), ["--oscillator", "force_kn"], "INPUT,OUTPUT"),
    ],
)
def test_bad_input_gives_one_message_and_exit_code_2(tmp_path, capsys, change, options, says):
    t, x = motion(1)
    data = np.column_stack(change(t, 1e3 * x, 1e-3 * force(t, x, 1)))
    path = tmp_path / "a.csv"
    np.savetxt(path, data, delimiter=",", header="time_s,displacement_mm,force_kn", comments="")
    assert main(["identify", str(path), "--out", str(tmp_path / "out"), *options]) == 2
    message = capsys.readouterr().err
    assert says in message and "Traceback" not in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("which", "says"), [("clipped", "force looks clipped"), ("other", "explains hardly anything")])
def test_doubtful_records_are_warned_of(tmp_path, capsys, which, says):
    t, x = motion(1)
    f = np.clip(force(t, x, 1), -300.0, 300.0) if which == "clipped" else np.random.default_rng(0).normal(0.0, 300.0, t.size)
    path, out = tmp_path / "a.csv", tmp_path / "out"
    columns = np.column_stack([t, 1e3 * x, 1e-3 * f])
    np.savetxt(path, columns, delimiter=",", header="time_s,displacement_mm,force_kn", comments="")
    assert main(["identify", str(path), "--model", "kelvin_voigt", "--out", str(out)]) == 0
    assert says in capsys.readouterr().err
    assert any(says in w for w in read(out)["warnings"])


@pytest.mark.parametrize("name", ["missing.csv", "broken.npz", "broken.mat", "empty.csv", "folder"])
def test_unreadable_files(tmp_path, capsys, name):
    path = tmp_path / name
    if name == "folder":
        path.mkdir()
    elif name != "missing.csv":
        path.write_bytes(b"" if name == "empty.csv" else b"not a data file")
    assert main(["identify", str(path), "--out", str(tmp_path / "out")]) == 2
    assert name in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("model", ["jounce_bumper", "local_linear_network_dahl"])
def test_jounce_route(tmp_path, model):
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))
    import jounce_programme

    names = []
    for name, (t, u, f, _) in jounce_programme.measured(3).items():
        # extension and tension positive, as in the vehicle
        np.savez(tmp_path / f"{name}.npz", time_s=t, displacement_mm=-1e3 * u, force_kn=-1e-3 * f)
        names.append(str(tmp_path / f"{name}.npz"))
    out = tmp_path / "out"
    assert main(["identify", *names, "--model", model, "--local-models", "6", "--out", str(out)]) == 0
    found = read(out)
    assert np.mean(list(found["nrmse_fitted"].values())) < 0.05
    assert set(found["nrmse_held_out"]) == {f"{n}.npz" for n in ("dynamic_ramps", "amplitude_sweep", "road_a", "road_b")}
    # a network that does not carry over to records left out is no element to be used, and it is said
    refused = model != "jounce_bumper" and bool(found["choice_of_network"]["refusal"])
    assert (out / "element.yaml").exists() == (not refused)
    assert not refused or found["choice_of_network"]["refusal"] in found["warnings"]
    # the bumper was pushed 75 mm; the 80 mm of rebound on the roads show nothing of it
    assert 0.07 < found["seen_in_data"]["largest_deflection_m"] < 0.076
    element = element_from_mapping(found["element"])
    t, u, f, _ = jounce_programme.measured(3)["road_b"]
    response = element.response(t, -u)
    assert np.sqrt(np.mean((response + f)[u > 0] ** 2)) < 0.08 * np.std(f[u > 0])
