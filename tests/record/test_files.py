"""Result files: what is written is read back, a stopped run keeps its states, broken files are told in a sentence."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.valve import Valve
from dbvfiv.errors import CaseError
from dbvfiv.geometry.surface import key_point_table
from dbvfiv.materials.shipped import published_rubber
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.record.files import Attachment, Header, kind_of, read_header, refuse_foreign, write_header
from dbvfiv.record.record import Journal
from dbvfiv.shell.recovery import layer_fields
from dbvfiv.studies.case import Case
from tests.observers import Stop


@pytest.fixture(scope="module")
def stored(coarse_run):
    return dbvfiv.load_result(coarse_run.path)


def test_everything_comes_back(coarse_run, stored):
    assert stored.summary() == coarse_run.summary()
    assert stored.complete and stored.kind == "steady"
    for ours, theirs in zip(stored.states, coarse_run.states, strict=True):
        for name in ("nodal", "station_area", "station_velocity", "station_pressure"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
        assert ours.layers.names == theirs.layers.names == ("CR", "SBR", "fibre", "fibre", "EPDM")
        for name in ("strain", "stress", "von_mises", "stretch"):
            assert np.array_equal(getattr(ours.layers, name), getattr(theirs.layers, name)), name


def test_layers_are_those_of_the_shell(coarse_run, stored):
    state = stored.states[-1]
    again = layer_fields(coarse_run.model.shell, state.q)
    assert np.array_equal(again.von_mises, state.layers.von_mises)
    # the plies carry the load: their stress is several times that of the rubber (Th. ch. 7)
    ply, rubber = state.layers.von_mises[:, 2:4].max(), state.layers.von_mises[:, [0, 1, 4]].max()
    assert ply > 3 * rubber


def test_station_data_belong_together(stored):
    density = stored.case.fluid.density
    for state in stored.states:
        flow = 4 * density * state.station_area * state.station_velocity
        assert np.allclose(flow, state.mass_flow, rtol=1e-6)
        head = state.station_pressure + 0.5 * density * state.station_velocity**2
        assert np.allclose(head, head[0], rtol=1e-6)
        assert state.station_pressure[0] == pytest.approx(0, abs=1e-9) and state.station_pressure[-1] == pytest.approx(
            state.pressure
        )


def test_the_model_can_be_rebuilt_and_the_state_is_an_equilibrium(stored):
    state = stored.states[1]
    model = stored.model
    unbalanced = np.linalg.norm(model.residual(state.q, state.pressure)) / model.force_scale(state.q, state.pressure)
    assert unbalanced < 1e-7
    restarted = LoadPath(model, pressure=state.pressure, q=state.q).go_to(state.pressure * 1.01)
    assert restarted.iterations <= 4 and restarted.mass_flow > state.mass_flow


def test_numbers_carry_units_case_and_versions(coarse_run):
    with h5py.File(coarse_run.path) as file:
        assert (
            file["tables/states/mass_flow"].attrs["units"] == "kg/s"
            and file["tables/states/mass_flow"].attrs["description"]
        )
        assert file["tables/states/layers/von_mises"].attrs["units"] == "Pa"
        assert file["mesh/nodes"].attrs["units"] == "m"
        assert "[drive]" in file["case/toml"].asstr()[()]
        assert {"numpy", "jax", "petsc", "petsc scalar type", "dbvfiv"} <= set(file["versions"].attrs)


def test_files_of_the_case_travel_with_the_result(tmp_path, coarse_run, monkeypatch):
    law = published_rubber("CR", 0.1)
    stretch = np.linspace(1.01, 1.3, 20)
    stress = 2 * (stretch - stretch**-2) * (law.parameters[0] + law.parameters[1] / stretch)
    data = tmp_path / "tension.csv"
    data.write_text("strain,stress\n" + "".join(f"{s - 1:.6f},{p:.6e}\n" for s, p in zip(stretch, stress)))
    own = {"kind": "fit", "path": str(data), "density": 1300, "loss_factor": "CR"}
    case = Case().replace({"mesh.around": 8, "mesh.along": 16, "materials.own": own, "layers.0.material": "own"})
    monkeypatch.setenv("DBVFIV_CACHE", str(tmp_path / "cache"))
    with h5py.File(tmp_path / "h.h5", "w") as file:
        write_header(file, Header.of("steady", case))
        data.unlink()
        again = read_header(file, Case).rebuildable_case()
    path = again.materials.named["own"].path
    assert path != data and path.read_text().startswith("strain,stress")


def _kept(tmp_path, case: Case, name="h.h5") -> Header:
    """Header of a case out of a file that was written and read."""
    with h5py.File(tmp_path / name, "w") as file:
        write_header(file, Header.of("steady", case))
    return _read(tmp_path, name)


def _read(tmp_path, name="h.h5") -> Header:
    with h5py.File(tmp_path / name) as file:
        return read_header(file, Case)


def test_a_kept_case_knows_which_keys_were_given(tmp_path, monkeypatch):
    """Pressures that were not given are asked of no valve: a soft one bears its own, and not the usual ones."""
    monkeypatch.setenv("DBVFIV_CACHE", str(tmp_path / "cache"))
    case = Case().replace({"drive.pressure": 1e3, "valve.wall_thickness": 0.01})
    kept = _kept(tmp_path, case)
    for again in (kept.case, replace(kept, attachments=(Attachment("none.csv", b""),)).rebuildable_case()):
        assert again == case and again.given == case.given
        assert again.steady_pressures() == (1e3,) and again.straining_pressures() == (1e3, None)
    with h5py.File(tmp_path / "h.h5", "a") as file:
        del file["case/given"]
    assert _read(tmp_path).case.straining_pressures() == (50e3, 28e3)  # of an earlier version: every key


def test_keys_that_said_nothing_are_left_out_of_cases_of_earlier_versions(tmp_path):
    _kept(tmp_path, Case())
    with h5py.File(tmp_path / "h.h5", "a") as file:
        data = json.loads(file["case/json"][()])
        data["outside"]["pipe_diameter"], data["transient"]["coupling"] = 0.33, "staggered"
        data["mesh"] |= {"rows": "uniform", "breaks": [0.1]}
        data["fluid"]["unsteady"] = False
        file["case/json"][()] = json.dumps(data)
    assert _read(tmp_path).case == Case().replace({"mesh.rows": "uniform", "fluid.unsteady": False})


LATIN = "# \u00b5\nfrequency,tan delta\n1,0.1\n200,0.2\n".encode("latin-1")


@pytest.mark.parametrize(
    ("key", "form", "data"),
    [
        ("materials.CR", {"loss_data": "{}"}, LATIN),
        ("materials.CR", {"kind": "fit", "path": "{}", "density": 1300, "loss_factor": 0.1}, b"PK\x03\x04\0workbook"),
        ("uncertainty.inputs", {"density": "samples({})"}, b"990\n1000\n1010\n"),
    ],
)
def test_files_of_any_contents_stay_with_a_result_and_its_case(tmp_path, monkeypatch, key, form, data):
    monkeypatch.setenv("DBVFIV_CACHE", str(tmp_path / "cache"))
    own = tmp_path / "own.dat"
    own.write_bytes(data)
    given = {name: value.format(own) if isinstance(value, str) else value for name, value in form.items()}
    case = Case().replace({key: given})
    assert _kept(tmp_path, case).case == case
    own.write_bytes(b"other")
    (copy,) = _read(tmp_path).attachments
    assert copy.path != str(own) and copy.data == data
    with h5py.File(tmp_path / "again.h5", "w") as file:
        write_header(file, _read(tmp_path))
    shutil.rmtree(tmp_path / "cache")
    again = _read(tmp_path, "again.h5").rebuildable_case()
    assert copy.path in json.dumps(again.to_dict()) and Path(copy.path).read_bytes() == data


def test_key_points_that_are_gone_still_give_their_valve(tmp_path, monkeypatch):
    monkeypatch.setenv("DBVFIV_CACHE", str(tmp_path / "cache"))
    small, points = Valve(flange_radius=0.06, lip_half_width=0.1), tmp_path / "points.csv"
    points.write_text(key_point_table(small, 17))
    own = {"valve.key_points": str(points), "downstream.pipe_diameter": 0.25}
    case = Case().replace(own)
    kept = _kept(tmp_path, case)
    points.unlink()
    assert kept.case == case and _read(tmp_path).case.valve.inlet_radius == pytest.approx(0.06)


def test_a_file_that_has_changed_is_not_taken_for_the_one_that_was_kept(tmp_path, monkeypatch, refused):
    """A changed file is refused where the copy cannot be written; one that has gone is missed where it is read."""
    (tmp_path / "taken").write_text("a file where the cache should be")
    monkeypatch.setenv("DBVFIV_CACHE", str(tmp_path / "taken"))
    own = Attachment(str(tmp_path / "own.csv"), LATIN)
    assert own.place() == own.path
    Path(own.path).write_bytes(b"other")
    with refused(CaseError, match="has changed since the result was made"):
        own.place()
    Path(own.path).write_bytes(LATIN)
    assert own.place() == own.path


def test_a_result_takes_the_place_of_a_result_alone(tmp_path, refused):
    """Not of a device; where a link leads to one, that file."""
    os.mkfifo(tmp_path / "pipe.h5")
    with refused(CaseError, match="no file that can hold a result"):
        refuse_foreign(tmp_path / "pipe.h5")
    assert (tmp_path / "pipe.h5").is_fifo()
    (tmp_path / "link.h5").symlink_to(tmp_path / "run.h5")
    with Journal(tmp_path / "link.h5", Header.of("steady", Case()), None, ()):
        pass
    assert (tmp_path / "link.h5").is_symlink() and kind_of(tmp_path / "run.h5") == "steady"


def test_texts_of_earlier_versions_are_read(tmp_path):
    own = tmp_path / "own.csv"
    own.write_bytes(LATIN)
    _kept(tmp_path, Case().replace({"materials.CR.loss_data": str(own)}))
    with h5py.File(tmp_path / "h.h5", "a") as file:
        del file["case/files/0"]
        file["case/files"].create_dataset("0", data="1,0.1 \u00b5", dtype=h5py.string_dtype()).attrs["path"] = str(own)
    assert _read(tmp_path).attachments[0].data == "1,0.1 \u00b5".encode()


def test_a_stopped_run_keeps_what_it_found(tmp_path, coarse_valve, coarse_run):
    """And a killed one, by what lies on the disk after each state, without the file ever being closed."""
    path, copy = tmp_path / "running.h5", tmp_path / "killed.h5"

    class Look(Stop):
        def item(self, state):
            shutil.copy(path, copy)
            left = dbvfiv.load_result(copy)
            assert len(left.states) == len(self.seen) + 1 and not left.complete
            assert np.array_equal(left.states[-1].layers.stress, coarse_run.states[len(self.seen)].layers.stress)
            super().item(state)

    look = Look(2)
    coarse_valve.steady([6e3, 18e3, 36e3], output=path, observer=look)
    assert len(look.seen) == 2 and look.ended
    kept = dbvfiv.load_result(path)
    assert not kept.complete and kept.summary()["interrupted"]
    assert [state.pressure for state in kept.states] == [6e3, 18e3]
    assert kept.states[1].layers.von_mises.shape == (128, 5)
    again = dbvfiv.resume(path)
    assert again.complete and dbvfiv.load_result(path).summary() == again.summary() == coarse_run.summary()


def test_failures_are_kept_apart_from_warnings(tmp_path, coarse_valve):
    valve = coarse_valve.replace({"steady.max_iterations": 2, "steady.min_step": 0.3})
    result = valve.steady(pressure=[100.0], output=tmp_path / "failed.h5")
    kept = dbvfiv.load_result(tmp_path / "failed.h5")
    assert kept.failures == result.failures and len(kept.failures) == 1 and "No equilibrium" in kept.failures[0]
    assert not set(kept.failures) & set(kept.warnings) and kept.states == ()


def test_saving_gives_the_same_file(tmp_path, stored):
    stored.save(tmp_path / "copy.h5")
    copy = dbvfiv.load_result(tmp_path / "copy.h5")
    assert copy.summary() == stored.summary() and copy.header.created == stored.header.created
    stored.states[0].save(tmp_path / "one.h5")
    assert [s.pressure for s in dbvfiv.load_result(tmp_path / "one.h5").states] == [6e3]


def _damage(path, kind):
    whole = path.read_bytes()
    if kind == "text":
        path.write_text("[drive]\npressure = 3\n")
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif kind == "foreign":
        with h5py.File(path, "w") as file:
            file["x"] = 1
    else:
        with h5py.File(path, "r+") as file:
            if kind == "newer":
                file.attrs["layout"] = 99
            elif kind == "unknown":
                file.attrs["dbvfiv_kind"] = "horoscope"
            elif kind == "no states":
                del file["tables/states"]
            elif kind == "no case":
                del file["case/json"]
            elif kind == "bad case":
                del file["case/json"]
                file["case/json"] = "{"


@pytest.mark.parametrize(
    "kind", ["text", "empty", "cut", "foreign", "newer", "unknown", "no states", "no case", "bad case"]
)
def test_broken_files_are_one_sentence(tmp_path, coarse_run, kind, refused):
    path = tmp_path / "r.h5"
    path.write_bytes(coarse_run.path.read_bytes())
    _damage(path, kind)
    with refused(CaseError):
        dbvfiv.load_result(path)


def test_a_file_of_a_metric_that_is_no_more(tmp_path, coarse_run, refused):
    path = tmp_path / "r.h5"
    path.write_bytes(coarse_run.path.read_bytes())
    with h5py.File(path, "r+") as file:
        case = json.loads(file["case/json"].asstr()[()])
        case["shell"]["metric"] = "true"
        del file["case/json"]
        file["case/json"] = json.dumps(case)
    with refused(CaseError, match='shell.metric .*"first-order" or "shifted"'):
        dbvfiv.load_result(path)


def test_missing_files_and_folders(tmp_path, refused):
    for path in (tmp_path, tmp_path / "none.h5"):
        with refused(CaseError):
            dbvfiv.load_result(path)


def test_only_results_are_overwritten(tmp_path, coarse_run, refused):
    precious = tmp_path / "precious.toml"
    precious.write_text("[drive]\n")
    for path in (precious, tmp_path):
        with refused(CaseError):
            coarse_run.save(path)
    assert precious.read_text() == "[drive]\n"
    for _ in range(2):
        coarse_run.save(tmp_path / "r.h5")
