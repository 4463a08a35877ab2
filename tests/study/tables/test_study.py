"""A study directory: begun, compared, changed; every step kept, nothing lost."""

import shutil

import pytest

from specan.errors import ComputationError, RequestError
from specan.report.study_report import study_report
from specan.study.create import begin
from specan.study.edit import add_effect, drop_effect
from specan.study.history import History, commit
from specan.study.study import Study
from specan.study.study_file import read_study_file
from specan.study.user_effects import read_effect_file

SEAL = {"seal-drag.torque": 0.3}
LOAD = {"load-dependent-friction.change": -0.012, "load-dependent-friction.exponent": 1.0}

OWN = '''from specan.models import Parameter, effect


@effect("my-drag", adds_to="no_load_loss", neutral={"torque": 0.0})
def my_drag(worm_speed, *, torque=Parameter(0.1, "N*m", min=0.0, max=1.0)):
    """A brake that drags."""
    return torque * worm_speed
'''


@pytest.fixture(autouse=True)
def own_machine(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))


@pytest.fixture(scope="module")
def begun(tables, tmp_path_factory):
    """A rig and a table with friction that falls with the load, and a study of them."""
    place = tmp_path_factory.mktemp("begun")
    table = tables.write_table(place / "table.csv", tables.bench(effects=LOAD))
    rig = tables.write_rig(place / "rig.toml", torque_setting_percent=5.0)
    begin(place / "study", "worm-gear", rig, [table], hold_out=["torque=50"])
    return place


@pytest.fixture
def files(begun, tmp_path):
    return tuple(shutil.copy(begun / name, tmp_path / name) for name in ("rig.toml", "table.csv"))


@pytest.fixture
def study(begun, files, tmp_path):
    return Study(shutil.copytree(begun / "study", tmp_path / "study"))


def text_of(study):
    return (study.directory / "study.toml").read_text(encoding="utf-8")


def edit(study, old, new):
    path = study.directory / "study.toml"
    assert old in text_of(study)
    path.write_text(text_of(study).replace(old, new), encoding="utf-8")
    return Study(study.directory)


def test_a_study_begins_with_a_step_and_a_file_that_a_person_can_read(study, files):
    assert "[[measurement]]" in text_of(study)
    assert '"../table.csv"' in text_of(study)
    assert "\n\n\n" not in text_of(study)
    assert study.content.rig == "../rig.toml"
    [step] = History(study.directory).steps
    assert step.action == "new"
    assert step.fit_error["unit"] == "N*m"
    assert step.held_out_error is not None
    assert step.hashes["files"] == {"../table.csv": study.content.measurement[0].sha256}
    assert step.reduced_chi2 > 3


def test_what_cannot_be_begun_leaves_nothing_behind(files, tmp_path, tables):
    target = tmp_path / "other"
    for wrong, told in (
        ({"model_name": "wormgear"}, "did you mean 'worm-gear'"),
        ({"measurements": []}, "needs a measurement"),
        ({"measurements": [tmp_path / "no.csv"]}, "does not exist"),
        ({"hold_out": ["torque=77"]}, "no row has"),
        ({"effects": ["seal-drug"]}, "did you mean 'seal-drag'"),
    ):
        given = {"model_name": "worm-gear", "rig": files[0], "measurements": [files[1]], **wrong}
        with pytest.raises(RequestError, match=told):
            begin(target, **given)
        assert not target.exists()
    few = {n: v[:4] for n, v in tables.bench(effects=LOAD).items()}
    with pytest.raises(RequestError, match="cannot determine"):
        begin(target, "worm-gear", files[0], [tables.write_table(tmp_path / "few.csv", few)])
    assert not target.exists()


def test_a_second_study_does_not_take_the_place_of_the_first(study, files):
    with pytest.raises(RequestError, match="holds a study already"):
        begin(study.directory, "worm-gear", files[0], [files[1]])
    assert len(History(study.directory).steps) == 1


def test_adding_what_is_missing_lets_both_errors_fall(study):
    change = add_effect(study, "load-dependent-friction", "the loss bends")
    assert change.after.fit_error["value"] < 0.5 * change.before.fit_error["value"]
    assert change.after.held_out_error["value"] < 0.5 * change.before.held_out_error["value"]
    assert change.after.held_out_reduced_chi2 < 1.7
    low, high = (change.after.parameters["load-dependent-friction.change"][e] for e in ("low", "high"))
    assert low < -0.012 < high
    assert not any("does not fall" in r or "rises" in r for r in change.remarks)
    steps = History(study.directory).steps
    assert [s.action for s in steps] == ["new", "add"]
    assert steps[1].because == "the loss bends"
    assert Study(study.directory).model_effects[-1] == "load-dependent-friction"


@pytest.mark.long
def test_adding_what_is_not_missing_is_kept_and_said(study):
    first = add_effect(study, "load-dependent-friction").study
    change = add_effect(first, "bearing-preload")
    assert any("bearing-preload is not supported by the data" in r for r in change.remarks)
    assert len(History(study.directory).steps) == 3


def test_dropping_goes_back_and_keeps_the_steps(study):
    added = add_effect(study, "load-dependent-friction")
    back = drop_effect(added.study, "load-dependent-friction", "a test")
    assert back.after.fit_error["value"] == pytest.approx(added.before.fit_error["value"], rel=1e-6)
    assert [s.action for s in History(study.directory).steps] == ["new", "add", "drop"]
    with pytest.raises(RequestError, match="not in the model"):
        drop_effect(back.study, "load-dependent-friction")


@pytest.mark.long
def test_an_effect_that_another_makes_superfluous_is_named(tables, tmp_path, files):
    started = begin(
        tmp_path / "s", "worm-gear", files[0], [files[1]],
        effects=["bearing-friction", "churning", "tooth-friction", "oil-heating"],
    )  # fmt: skip
    step = started.step
    assert "oil-heating.resistance" in step.parameters
    change = add_effect(started.study, "load-dependent-friction")
    before = [r for r in change.remarks if "no longer needed" in r]
    assert before in ([], ["oil-heating is no longer needed"])


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("seal-drg", "did you mean 'seal-drag'"),
        ("tooth-friction", "in the model already.*tooth-friction@2"),
        ("running-in", "needs elapsed_time"),
        ("seal-drag@z1", "acts everywhere"),
    ],
)
def test_what_cannot_be_added_changes_nothing(study, name, told):
    before = text_of(study)
    with pytest.raises(RequestError, match=told):
        add_effect(study, name)
    assert text_of(study) == before
    assert len(History(study.directory).steps) == 1


def test_a_fit_that_fails_leaves_the_study_as_it_was(study, monkeypatch):
    before = text_of(study)

    def fails(*args, **more):
        raise ComputationError("it did not converge")

    study.step("now")
    monkeypatch.setattr("specan.study.edit.hold_undetermined", fails)
    with pytest.raises(ComputationError):
        add_effect(study, "seal-drag")
    assert text_of(study) == before
    assert len(History(study.directory).steps) == 1


def test_comments_and_order_of_a_person_stay(study):
    changed = edit(study, "[[measurement]]", "# our own bench, winter\n[[measurement]]")
    add_effect(changed, "load-dependent-friction")
    text = text_of(study)
    assert "# our own bench, winter" in text
    assert text.index("churning") < text.index("load-dependent-friction")


def test_an_edit_by_hand_becomes_a_step(study):
    assert study.record_changes() is None
    changed = edit(study, 'name = "churning"\n', 'name = "churning"\nparameters.exponent = {fixed = true}\n')
    assert "churning.exponent" not in changed.problem.names
    step = changed.record_changes()
    assert step.action == "edit"
    commented = edit(changed, "# A specan study.", "# Another comment.")
    assert commented.record_changes() is None


def test_what_the_file_says_of_parameters_is_done(study):
    said = (
        'name = "churning"\n'
        "parameters.exponent = {value = 1.4, low = 1.0, high = 1.6}\n"
        'parameters.power = {value = 0.09, unit = "kW"}\n'
        "parameters.constant = {fixed = true, value = 2.0}\n"
    )
    changed = edit(study, 'name = "churning"\n', said)
    problem = changed.problem
    assert problem.domain("churning.exponent") == (1.0, 1.6)
    assert problem.start()[problem.names.index("churning.power")] == pytest.approx(90.0)
    values = problem.values_at(problem.start())
    assert values["churning.constant"] == 2.0


@pytest.mark.long
def test_a_parameter_may_have_one_value_for_each_file(tables, tmp_path, files):
    rougher = {"speed-dependent-friction.rise": 0.0, "speed-dependent-friction.speed": 1.0}
    columns = tables.bench(seed=3, effects=rougher)
    columns["input_torque_Nm"] += 0.02 * columns["output_torque_Nm"] / 7.5
    second = tables.write_table(tmp_path / "second.csv", columns)
    first = tables.write_table(tmp_path / "first.csv", tables.bench(seed=4))
    study = begin(tmp_path / "both", "worm-gear", files[0], [first, second]).study
    apart = edit(
        study, 'name = "tooth-friction"\n', 'name = "tooth-friction"\nparameters.mu = {per = "recording"}\n'
    )
    names = ("tooth-friction.mu[first.csv]", "tooth-friction.mu[second.csv]")
    assert set(names) <= set(apart.problem.names)
    one, two = (apart.compare().parameters[name]["value"] for name in names)
    assert two - one > 0.002
    assert apart.best.chi2 < study.best.chi2 - 50


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("schema = 1", "schema = 2", "schema"),
        ('kind = "table"', 'kynd = "table"', "did you mean 'kind'"),
        ('name = "churning"', 'name = "churnig"', "did you mean 'churning'"),
        ('name = "churning"', 'name = "churning"\nparameters.exponnt = {fixed = true}', "churning.exponent"),
        ('name = "churning"', 'name = "churning"\nparameters.power = {unit = "m", value = 1}', "unit"),
        ('name = "churning"', 'name = "churning"\nparameters.power = {low = 2, high = 1}', "low < high"),
        ('where = "torque=50"', 'where = "torque=51,130"', "no row has"),
        ("[[effect]]", "[[effect]", "not valid TOML"),
    ],
)
def test_a_fault_in_the_file_is_named(study, old, new, told):
    with pytest.raises(RequestError, match=told):
        edit(study, old, new)


def test_changed_data_are_noticed_and_accepted_on_request(study, files):
    table = files[1]
    table.write_text(table.read_text() + "# a remark\n")
    with pytest.raises(RequestError, match=r"table\.csv changed since .* --accept-changes"):
        Study(study.directory)
    accepted = Study(study.directory, accept_changes=True)
    assert accepted.record_changes().action == "data"
    assert Study(study.directory).edited is False


def test_a_measurement_that_is_gone_is_said(study, files):
    files[1].unlink()
    with pytest.raises(RequestError, match="cannot be read"):
        Study(study.directory)


def test_the_rig_is_part_of_the_state(study, files):
    rig = files[0]
    rig.write_text(rig.read_text() + "input_torque_Nm = 0.02\n")
    assert Study(study.directory).record_changes().action == "edit"


@pytest.mark.long
def test_own_effects_work_in_every_step(study, tmp_path):
    own = tmp_path / "mine.py"
    own.write_text(OWN)
    change = add_effect(study, str(own), "an idea")
    assert "my-drag" in change.after.model_effects
    assert (study.directory / "effects" / "mine.py").read_text() == OWN
    assert "my-drag.torque" in Study(study.directory).problem.names
    assert drop_effect(change.study, "my-drag").after.action == "drop"


def test_own_effects_are_candidates_once_they_were_named(study, tmp_path):
    own = tmp_path / "mine.py"
    own.write_text(OWN)
    opened = Study(study.directory, effects=[own])
    assert "my-drag" in opened.model.effects
    assert "my-drag" not in opened.model_effects
    assert "my-drag" in Study(study.directory).model.effects


def test_an_effect_from_elsewhere_runs_only_after_it_was_named_here(study, tmp_path, monkeypatch):
    own = tmp_path / "mine.py"
    own.write_text(OWN)
    add_effect(study, str(own))
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "another machine"))
    with pytest.raises(RequestError, match=r"has not been run on this machine.*--effect"):
        Study(study.directory)
    inside = study.directory / "effects" / "mine.py"
    assert "my-drag" in Study(study.directory, effects=[inside]).model_effects
    assert "my-drag" in Study(study.directory).model_effects


def test_a_changed_effect_file_is_noticed_and_the_old_one_kept(study, tmp_path):
    own = tmp_path / "mine.py"
    own.write_text(OWN)
    add_effect(study, str(own))
    inside = study.directory / "effects" / "mine.py"
    inside.write_text(OWN + "# changed\n")
    with pytest.raises(RequestError, match="was changed since it was added"):
        Study(study.directory)
    Study(study.directory, effects=[inside])
    own.write_text(OWN + "# once more\n")
    Study(study.directory, effects=[own])
    assert len(list(inside.parent.iterdir())) == 2


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("def broken(:\n", "not valid Python"),
        (OWN.replace("worm_speed", "worm_sped"), "did you mean 'worm_speed'"),
        (OWN.replace("my-drag", "seal-drag"), "a name that specan uses already"),
        ("x = 1\n", "holds no effect"),
    ],
)
def test_a_fault_in_an_effect_file_is_named(study, tmp_path, content, told):
    own = tmp_path / "mine.py"
    own.write_text(content)
    with pytest.raises(RequestError, match=told):
        add_effect(study, str(own))
    assert not (study.directory / "effects").exists()
    assert Study(study.directory).content.effect_file == ()


def test_a_directory_in_place_of_an_effect_file_is_named(tmp_path):
    with pytest.raises(RequestError, match="cannot be read"):
        read_effect_file(tmp_path)


def test_nothing_is_concluded_where_nothing_tells_the_uncertainty(tables, tmp_path):
    columns = tables.grid()
    columns["input_torque_Nm"] = tables.input_torque(columns) * 1.0001234
    path = tables.write_table(tmp_path / "t.csv", columns)
    begun = begin(tmp_path / "s", "worm-gear", tables.write_rig(tmp_path / "r.toml"), [path])
    assert begun.step.reduced_chi2 is None
    assert begun.study.compare().localisation is None
    with pytest.raises(RequestError, match="the uncertainty of the measurement"):
        begun.study.diagnose()


def test_the_ideal_machine_is_a_start(files, tmp_path):
    begun = begin(tmp_path / "s", "worm-gear", files[0], [files[1]], effects=[])
    assert begun.step.model_effects == ()
    assert begun.step.fit_error["value"] > 0.5
    first = add_effect(begun.study, "tooth-friction")
    assert first.after.fit_error["value"] < begun.step.fit_error["value"]


@pytest.mark.long
def test_an_instrument_error_goes_out_of_its_certificate_and_back(tables, tmp_path):
    rig = tables.write_rig(tmp_path / "r.toml", input_torque_zero_Nm=0.01, input_torque_Nm=0.01)
    columns = tables.bench()
    columns["input_torque_Nm"] += 0.2
    path = tables.write_table(tmp_path / "t.csv", columns)
    study = begin(tmp_path / "s", "worm-gear", rig, [path]).study
    assert study.problem.priors == {"torque-zero-error.input": (0.0, pytest.approx(0.01))}
    change = add_effect(study, "torque-zero-error")
    assert change.study.problem.priors == {}
    assert "torque-zero-error" in change.after.model_effects
    back = drop_effect(change.study, "torque-zero-error")
    assert back.study.problem.priors == study.problem.priors


@pytest.mark.long
def test_a_validation_file_is_only_predicted(tables, tmp_path, files):
    other = tables.write_table(tmp_path / "other.csv", tables.bench(seed=5, effects=LOAD))
    study = begin(tmp_path / "s", "worm-gear", files[0], [files[1]], validations=[other]).study
    assert study.problem.n_data == 48
    assert study.held_out.n == 48
    fitted = Study(study.directory)
    assert fitted.best.chi2 == pytest.approx(study.best.chi2)
    other.write_text(other.read_text() + "# later\n")
    with pytest.raises(RequestError, match=r"other\.csv changed"):
        Study(study.directory)


def test_a_damaged_history_is_said_with_its_line_and_kept(study):
    """Half a line, as a crash of another program leaves it, costs no other step and stays where it is."""
    path = study.directory / "history.jsonl"
    before = path.read_text(encoding="utf-8")
    path.write_text(before + '{"step": 1, "act', encoding="utf-8")
    again = Study(study.directory)
    assert [s.step for s in again.history.steps] == [0]
    assert "line 2 is damaged" in again.history.ignored[0]
    commit(study.directory, None, before)
    assert path.read_text(encoding="utf-8") == before + '{"step": 1, "act\n' + before
    assert len(History(study.directory).steps) == 2
    path.write_text(before.replace('"observable"', '"obervable"'), encoding="utf-8")
    assert "errors.fit.0.observable: Field required" in History(study.directory).ignored[0]


def test_a_directory_without_a_study_is_said(tmp_path):
    with pytest.raises(RequestError, match="specan study new"):
        read_study_file(tmp_path)


def test_numbers_can_be_had_again_elsewhere(study, files, tmp_path):
    """A copy of directory, rig and data gives the same numbers to the last digit."""
    copy = tmp_path / "copy"
    copy.mkdir()
    for path in (*files, study.directory):
        (shutil.copytree if path.is_dir() else shutil.copy)(path, copy / path.name)
    again = Study(copy / "study").step("now")
    assert again.fit_error == study.history.steps[0].fit_error
    assert again.parameters == study.history.steps[0].parameters
    assert again.hashes == study.history.steps[0].hashes


@pytest.mark.long
def test_the_report_shows_names_as_text_and_needs_no_network(study, files, tmp_path):
    strange = files[1].with_name("<b>table & co<b>.csv")
    try:
        shutil.copy(files[1], strange)
    except OSError:
        pytest.skip("this file system knows no such names")
    own = begin(tmp_path / "<i>", "worm-gear", files[0], [strange], hold_out=["torque=50"]).study
    add_effect(own, "load-dependent-friction", "<script>alert(1)</script>")
    page = study_report(Study(own.directory))
    assert "http" not in page.replace("http-equiv", "")
    assert "<script>alert" not in page
    assert "&lt;script&gt;" in page
    assert "&lt;b&gt;table &amp; co" in page
    assert page.count("data:image/png;base64,") == 3
    assert "load-dependent-friction" in page
    assert "held out" in page
