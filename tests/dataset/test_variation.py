"""Variations: draws of their own for every place, ordinary scene files as result, faults named by key and sample."""

from __future__ import annotations

import pickle
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.dataset.sample import toml_text
from radarcore.dataset.variation import share_of
from scene_files import EXAMPLES, write
from varied_scenes import BALL, HEAD, PERSON


def loaded(folder: Path, text: str, head: str = HEAD) -> rc.dataset.Variation:
    return rc.dataset.Variation.load(write(folder, text, head))


def test_draws_are_those_of_the_hash_that_the_page_names(tmp_path: Path) -> None:
    """A fixed value: `printf 1/3/body.ball.pose.position[0] | b2sum -l 64` is 47d4ef75288b5ee0, a share of 0.2806."""
    from hashlib import blake2b

    assert blake2b(b"1/3/body.ball.pose.position[0]", digest_size=8).hexdigest() == "47d4ef75288b5ee0"
    share = (int("47d4ef75288b5ee0", 16) >> 11) / 2**53
    assert share_of(1, 3, "body.ball.pose.position[0]") == share
    sample = loaded(tmp_path, BALL).sample(3, seed=1)
    assert sample.values["body.ball.pose.position[0]"] == 1.0 + 2.0 * share


def test_parameters_have_the_units_of_their_keys(tmp_path: Path) -> None:
    noise = "radar.receiver = { output = 'real', noise_figure_db = { uniform = [10.0, 14.0] } }\n"
    box, ball = "{ kind = 'box', size = [{ uniform = [0.1, 0.2] }, 0.1, 0.1] }", "{ kind = 'sphere', radius = 0.1 }"
    turned = "\npose.rpy_deg = [0, 0, { uniform = [0, 90] }]\npose.position = [2.0, 0.0, 0.0]\n"
    head = 'run = { stop = 0.02, resolution = 32 }\nradar.preset = "bgt60tr13c"\nradar.num_chirps = 8\n'
    variation = loaded(
        tmp_path, f"{BALL}{PERSON}[[body]]\nname = 'a.b'\nshape.choice = [{box}, {ball}]{turned}", head + noise
    )
    units = {each.path: each.unit for each in variation.parameters}
    assert units == {
        "radar.receiver.noise_figure_db": "dB",
        "body.ball.pose.position[0]": "m",
        "body.ball.pose.position[1]": "m",
        "body.ball.material": "",
        "human.person.repeat": "",
        **{f"human.person {k}.height": "m" for k in range(3)},
        **{f"human.person {k}.speed": "m/s" for k in range(3)},
        **{f"human.person {k}.path[0][1]": "m" for k in range(3)},
        "body.a.b.shape": "",
        "body.a.b.shape{0}.size[0]": "m",
        "body.a.b.pose.rpy_deg[2]": "degrees",
        "run.seed": "",
    }


def test_order_of_samples_does_not_matter(tmp_path: Path) -> None:
    variation = loaded(tmp_path, BALL + PERSON)
    texts = [variation.sample(index, seed=2).text for index in range(6)]
    assert [variation.sample(index, seed=2).text for index in reversed(range(6))] == texts[::-1]
    assert [pickle.loads(pickle.dumps(variation)).sample(index, seed=2).text for index in range(6)] == texts
    assert len(set(texts)) == 6
    assert variation.sample(0, seed=3).text.splitlines()[1:] != texts[0].splitlines()[1:]


def test_further_distribution_leaves_the_others_as_they_are(tmp_path: Path) -> None:
    before = loaded(tmp_path, BALL).sample(4, seed=1).values
    after = loaded(tmp_path, f"{PERSON}{BALL}\n".replace("radius = 0.1", "radius = { uniform = [0.1, 0.2] }"))
    values = after.sample(4, seed=1).values
    assert before.items() <= values.items()
    assert "body.ball.shape.radius" in values


def test_resolved_file_loads_and_makes_the_same_frames(tmp_path: Path) -> None:
    variation = loaded(tmp_path, BALL + PERSON)
    (tmp_path / "elsewhere").mkdir()
    for index in range(3):
        sample = variation.sample(index, seed=1)
        sample.save(tmp_path / "elsewhere" / f"{index}.toml")
        alone = rc.load_scene(tmp_path / "elsewhere" / f"{index}.toml").record(progress=False)
        frames = list(sample.frames())
        assert len(frames) == len(alone) == 1
        np.testing.assert_array_equal(frames[0].cube, alone.cube[0])
        assert frames[0].truth is not None
        assert set(frames[0].truth.names) <= set(variation.body_names)
        position = sample.values["body.ball.pose.position[0]"]
        assert frames[0].truth.select(["ball"]).range[0] == pytest.approx(position - 0.1, abs=0.2)
    with pytest.raises(FileExistsError):
        sample.save(tmp_path / "elsewhere" / "0.toml")


def test_saved_file_finds_meshes_and_patterns(tmp_path: Path) -> None:
    shutil.copy(Path(EXAMPLES[0]).parent / "wedge.obj", tmp_path)
    np.savetxt(tmp_path / "gains.csv", [[-60, 0, 0], [60, 0, 0], [-60, 30, 1], [60, 30, 1]], delimiter=",")
    (tmp_path / "gains.csv").write_text(f"azimuth_deg,elevation_deg,gain_db\n{(tmp_path / 'gains.csv').read_text()}")
    text = 'pattern = { path = "gains.csv" }\n[[body]]\nshape = { kind = "mesh", path = "wedge.obj", scale = 1.0 }\n'
    variation = loaded(tmp_path, f"{text}pose.position = [{{ uniform = [2.0, 3.0] }}, 0.0, 0.0]\n")
    (tmp_path / "in" / "here").mkdir(parents=True)
    sample = variation.sample(0)
    sample.save(tmp_path / "in" / "here" / "sample.toml")
    np.testing.assert_array_equal(
        rc.load_scene(tmp_path / "in" / "here" / "sample.toml").simulator().frame(0.0).cube, next(sample.frames()).cube
    )


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_file_without_distributions_is_a_variation_of_its_noise(path: Path) -> None:
    variation = rc.dataset.Variation.load(path)
    assert [parameter.path for parameter in variation.parameters] in ([], ["run.seed"])
    table = tomllib.loads(variation.sample(0).text)
    original = tomllib.loads(path.read_text(encoding="utf-8"))
    assert table["radar"] == original["radar"]
    assert table.keys() == original.keys()


def test_writer_of_files_gives_back_what_it_was_given() -> None:
    nasty: dict[str, Any] = {
        "text": 'quote " backslash \\ newline \n delete \x7f, letter \u00e9 \U0001f600',
        "a key": {"b": 1e-7, "c": -0.0, "d": 1e300, "e": 3, "f": True, "nested key": {"x y": []}},
        "tables": [{"a": 1}, {"b": [[0.1, 2], ["x"]], "c": {}}],
        "none": [],
        "inf": float("inf"),
    }
    assert tomllib.loads(toml_text(nasty)) == nasty


def test_copies_have_names_and_draws_of_their_own(tmp_path: Path) -> None:
    variation = loaded(tmp_path, PERSON)
    paths = [parameter.path for parameter in variation.parameters]
    of_people = [f"human.person {k}.{key}" for k in range(3) for key in ("height", "speed", "path[0][1]")]
    assert paths == ["run.seed", "human.person.repeat", *of_people]
    assert {name.partition("/")[0] for name in variation.body_names} == {"person 0", "person 1", "person 2"}
    numbers = []
    for index in range(60):
        values = variation.sample(index, seed=1).values
        number = values["human.person.repeat"]
        numbers.append(number)
        assert [f"human.person {k}.speed" in values for k in range(3)] == [k < number for k in range(3)]
        assert len({values[f"human.person {k}.speed"] for k in range(number)}) == number
        assert all(values[f"human.person {k}.height"] in (1.5, 1.6, 1.7, 1.8, 1.9) for k in range(number))
    assert set(numbers) == {0, 1, 2, 3}
    assert variation.sample(0, seed=1).simulation().scene.names == variation.body_names[: 16 * numbers[0]]


def test_fixed_number_of_copies_is_no_parameter(tmp_path: Path) -> None:
    variation = loaded(tmp_path, BALL + "repeat = 2\n")
    assert variation.body_names == ("ball 0", "ball 1")
    sample = variation.sample(0)
    assert "body.ball.repeat" not in sample.values
    assert pickle.loads(pickle.dumps(sample)).text == sample.text


def test_unnamed_bodies_have_the_same_name_in_every_sample(tmp_path: Path) -> None:
    boxes = 'shape = { kind = "box", size = [0.1, 0.1, 0.1] }\npose.position = [2.0, 0.0, 0.0]\n'
    repeated = f'[[body]]\nname = "a"\nrepeat = {{ integers = [0, 2] }}\n{boxes}'
    variation = loaded(tmp_path, f"{repeated}[[point]]\nposition = [3.0, 0.0, 0.0]\n")
    assert variation.body_names == ("a 0", "a 1", "point 0")
    assert {variation.sample(index).simulation().scene.names[-1] for index in range(5)} == {"point 0"}


def test_choices_may_hold_tables_with_distributions(tmp_path: Path) -> None:
    shapes = '{ kind = "sphere", radius = { uniform = [0.05, 0.1] } }, { kind = "box", size = [0.1, 0.1, 0.1] }'
    material = '"wood", { reflection = { uniform = [-1.0, -0.5] } }'
    variation = loaded(
        tmp_path,
        f'[[body]]\nname = "thing"\nshape = {{ choice = [{shapes}] }}\nmaterial = {{ choice = [{material}] }}\n'
        "pose.position = [2.0, 0.0, 0.0]\n",
    )
    kinds = {parameter.path: parameter for parameter in variation.parameters}
    assert kinds["body.thing.shape"].ends == (0, 1)
    assert kinds["body.thing.material"].ends == ("wood", 1)
    assert not kinds["body.thing.material"].is_number
    for index in range(12):
        sample = variation.sample(index)
        (body,) = tomllib.loads(sample.text)["body"]
        assert (body["shape"]["kind"] == "sphere") == (sample.values["body.thing.shape"] == 0)
        assert ("body.thing.shape{0}.radius" in sample.values) == (body["shape"]["kind"] == "sphere")
        if isinstance(body["material"], dict):
            assert sample.values["body.thing.material"] == 1
            assert body["material"]["reflection"] == sample.values["body.thing.material{1}.reflection"]
        sample.simulation()


def test_names_of_bodies_are_those_of_all_arms_that_may_be_chosen(tmp_path: Path) -> None:
    urdf = '<robot name="small"><link name="base"/><link name="stick"><collision><geometry><box size="0.1 0.1 0.3"/>'
    joint = '<joint name="j" type="fixed"><parent link="base"/><child link="stick"/></joint>'
    (tmp_path / "small.urdf").write_text(f"{urdf}</geometry></collision></link>{joint}</robot>", encoding="utf-8")
    arms = "".join(
        f'[[arm]]\nname = "{name}"\nmodel = "{model}"\njoints = {{ kind = "rest", angles_deg = {angles} }}\n'
        f"pose.position = [{{ uniform = [2.0, 3.0] }}, {y}, 0.0]\n"
        for name, model, angles, y in (("a", "ur10", [0.0] * 6, 0.0), ("b", "small.urdf", [], 1.0))
    )
    variation = loaded(tmp_path, arms)
    assert variation.body_names[-1] == "b/stick"
    sample = variation.sample(0)
    (tmp_path / "deeper").mkdir()
    sample.save(tmp_path / "deeper" / "sample.toml")
    assert rc.load_scene(tmp_path / "deeper" / "sample.toml").scene.names == variation.body_names


def test_seed_of_the_noise_is_drawn_unless_it_is_given(tmp_path: Path) -> None:
    variation = loaded(tmp_path, BALL)
    seeds = {variation.sample(index).simulation().run.seed for index in range(20)}
    assert len(seeds) == 20
    fixed = loaded(tmp_path, BALL, HEAD.replace("stop = 0.02", "stop = 0.02, seed = 7"))
    assert fixed.sample(3).simulation().run.seed == 7
    assert "run.seed" not in fixed.sample(3).values


def test_sample_out_of_range_names_itself_key_and_value(tmp_path: Path) -> None:
    """A normal distribution without bounds: no ends to be tried."""
    variation = loaded(tmp_path, BALL.replace("radius = 0.1", "radius = { normal = [0.1, 0.1] }"))
    radii = {i: variation.sample(i, seed=1).values["body.ball.shape.radius"] for i in range(30)}
    bad = next(i for i, radius in radii.items() if radius < 0.0)
    with pytest.raises(ValueError, match=r"^sample \d+ of seed 1: .*body\[0\] 'ball': radius: expected a pos") as error:
        variation.sample(bad, seed=1).simulation()
    assert str(error.value).startswith(f"sample {bad} of seed 1: ")
    assert str(error.value).endswith(f"; drawn: body.ball.shape.radius = {radii[bad]:g}")
    good = next(i for i, radius in radii.items() if radius > 0.05)
    variation.sample(good, seed=1).simulation()


def test_meshes_of_samples_are_made_once(tmp_path: Path) -> None:
    """Of arms and bodies by their tables, of people by height and mass."""
    person = PERSON.replace("{ integers = [0, 3] }", "2").replace("{ uniform = [1.5, 1.9], step = 0.1 }", "1.8")
    arm = '[[arm]]\njoints = { kind = "rest", angles_deg = [{ uniform = [0, 90] }, -90, 0, 0, 0, 0] }\n'
    variation = loaded(tmp_path, BALL + person + f"{arm}pose.position = [0.0, 3.0, 0.0]\n")
    scenes = [variation.sample(index).simulation().scene for index in range(2)]
    meshes = [[body.mesh for body in scene.bodies if isinstance(body, rc.Body)] for scene in scenes]
    assert len(meshes[0]) == len(variation.body_names)
    assert all(one is other for one, other in zip(*meshes, strict=True))
