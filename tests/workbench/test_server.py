"""What the workbench answers, and to whom."""

from __future__ import annotations

import gzip
import json
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import httpx
import pytest
import uvicorn

from symcheck.errors import UsageError
from symcheck.workbench.app import Access, make_app
from symcheck.workbench.command import serve
from symcheck.workbench.project import NewerFileError, Project
from workbench.conftest import FOREVER, GRID, MODEL, PROPERTIES, write_files

TEXTS = {
    "model": MODEL,
    "properties": PROPERTIES,
    "model_name": "walk.nm",
    "properties_name": "walk.props",
}
QUESTIONS = ("/api/project", "/api/read", "/api/write", "/job/check")


class Client(httpx.Client):
    """A browser, without cookies at first."""

    def __init__(self, served: Served) -> None:
        super().__init__(base_url=f"http://{served.access.host}", timeout=60)
        self.served = served
        self.own = {"Origin": f"http://{served.access.host}"}


class Served:
    """A server in a thread, with a socket of its own."""

    def __init__(self, folder: Path) -> None:
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.access = Access(f"127.0.0.1:{self.socket.getsockname()[1]}")
        self.folder = folder
        self.app = make_app(Project(folder), self.access, {"model": "walk.nm"})
        config = uvicorn.Config(self.app, log_level="error", ws="none")
        self.server = uvicorn.Server(config)
        self.thread = Thread(target=self.server.run, kwargs={"sockets": [self.socket]})


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    served = Served(tmp_path_factory.mktemp("project"))
    served.thread.start()
    yield served
    served.server.should_exit = True
    served.thread.join()
    served.socket.close()


@pytest.fixture
def folder(served: Served) -> Path:
    """The files, as they are at first."""
    return write_files(served.folder)


@pytest.fixture
def access(served: Served) -> Access:
    return served.access


@pytest.fixture
def stranger(served: Served, folder: Path) -> Iterator[Client]:
    """A browser without the token."""
    with Client(served) as client:
        yield client


@pytest.fixture
def user(stranger: Client, access: Access) -> Client:
    assert stranger.get("/", params={"token": access.token}).status_code == 303
    return stranger


def ask(client: Client, question: str, /, **asked: object) -> Any:
    return client.post(f"/api/{question}", json=asked, headers=client.own).json()


def run(client: Client, worker: str = "check", **job: object) -> Any:
    """The messages of a job."""
    job = {**TEXTS, "constants": {"N": "4"}, **job}
    lines = client.post(f"/job/{worker}", json=job, headers=client.own).text.splitlines()
    return [json.loads(line) for line in lines]


# ------------------------------------------------------------------------------------------ access


@pytest.mark.parametrize("path", ["/", "/static/app.js", "/page/1", "/?token=", "/?token=é"])
def test_nothing_is_shown_without_the_token(stranger: Client, path: str) -> None:
    answer = stranger.get(path)
    assert (answer.status_code, "set-cookie" in answer.headers) == (403, False)
    assert "symcheck workbench has printed" in answer.text


@pytest.mark.parametrize("path", QUESTIONS)
def test_nothing_is_answered_without_the_token(stranger: Client, path: str) -> None:
    assert stranger.post(path, json={}, headers=stranger.own).status_code == 403


def test_the_token_becomes_a_cookie(stranger: Client, access: Access) -> None:
    answer = stranger.get("/", params={"token": access.token})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert access.token not in answer.headers["set-cookie"]
    page = stranger.get("/")
    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]


def test_the_token_on_a_command_line_serves_once(stranger: Client, access: Access) -> None:
    codes = [stranger.get("/", params={"token": access.once}).status_code]
    stranger.cookies.clear()
    codes += [stranger.get("/", params={"token": access.once}).status_code]
    assert codes == [303, 403]


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:9", "null", None])
@pytest.mark.parametrize("path", QUESTIONS)
def test_another_page_gets_nothing(user: Client, path: str, origin: str | None) -> None:
    headers = {} if origin is None else {"Origin": origin}
    answer = user.post(path, json={}, headers=headers)
    assert (answer.status_code, answer.text) == (403, "the request comes from another page")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8000", "127.0.0.1:9"])
def test_another_host_name_gets_nothing(user: Client, access: Access, host: str) -> None:
    for path in ("/", f"/?token={access.token}", "/static/app.js"):
        assert user.get(path, headers={"Host": host}).status_code == 403
    assert user.post("/api/project", json={}, headers={**user.own, "Host": host}).status_code == 403


def test_a_drawn_page_reaches_nothing(user: Client) -> None:
    address = run(user, "draw", do="page", states=10)[-1]["result"]["page"]
    policy = user.get(address).headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts; default-src 'none'")


GAME = """smg
player one m endplayer
module m x : [0..2] init 0; [] x<2 -> (x'=x+1); [] x=2 -> true; endmodule
"""


INTERVALS = (
    "dtmc module m x : [0..2] init 0; [] true -> [0.2,0.8]:(x'=1) + [0.2,0.8]:(x'=2); endmodule"
)


@pytest.mark.parametrize(
    ("model", "named"),
    [(GAME, "stochastic games"), (INTERVALS, "discrete-time Markov chains with intervals")],
)
def test_states_of_a_model_that_has_no_page_are_drawn(user: Client, model: str, named: str) -> None:
    job = {"model": model, "properties": "", "constants": {}, "states": 10, "room": [500, 400]}
    html = user.get(run(user, "draw", do="page", **job)[-1]["result"]["page"]).text
    assert f"pages are not available for {named}" in html
    assert all(f"x={x}" in html for x in range(3))


@pytest.mark.parametrize("kind", ["nonsense", "actions:type=dot", "../../x"])
def test_a_strategy_has_files_of_some_kinds_only(user: Client, kind: str) -> None:
    job = {"property": 'Pmin=? [ F "done" ]', "kind": kind}
    error = run(user, do="strategy files", **job)[-1]["error"]["message"]
    assert "actions, indices, induced, dot" in error


# ------------------------------------------------------------------------------------------- files


def test_a_file_is_written_as_a_whole(user: Client, folder: Path) -> None:
    file = ask(user, "read", name="walk.nm")
    assert file["text"] == MODEL
    version = ask(user, "write", name="walk.nm", text="ctmc // ü", version=file["version"])
    assert (folder / "walk.nm").read_text(encoding="utf-8") == "ctmc // ü"
    assert ask(user, "versions", names=["walk.nm"])["versions"] == {"walk.nm": version["version"]}
    assert {p.name for p in folder.iterdir()} == {
        *("walk.nm", "walk.props", "grid.pm", "grid.props"),
    }


def test_a_newer_file_is_not_overwritten(user: Client, folder: Path) -> None:
    file = ask(user, "read", name="walk.nm")
    (folder / "walk.nm").write_text("theirs")
    answer = ask(user, "write", name="walk.nm", text="mine", version=file["version"])
    assert answer["error"]["newer"]
    answer = ask(user, "write", name="walk.nm", text="mine", version="")  # as a new file
    assert answer["error"]["newer"]
    assert (folder / "walk.nm").read_text() == "theirs"


def test_line_ends_and_the_mode_of_a_file_stay(folder: Path) -> None:
    path = folder / "walk.nm"
    path.write_bytes(b"dtmc\r\n// one\r\n")
    path.chmod(0o640)
    project = Project(folder)
    text, version = project.read("walk.nm")
    assert text == "dtmc\n// one\n"
    project.write("walk.nm", text + "// two\n", version)
    assert path.read_bytes() == b"dtmc\r\n// one\r\n// two\r\n"
    assert path.stat().st_mode & 0o777 == 0o640
    with pytest.raises(NewerFileError):
        project.write("walk.nm", text, version)


@pytest.mark.parametrize(
    "name", ["../x.pm", "/etc/x.pm", "a/b.pm", "x.sh", ".bashrc", "", "..\\x.pm"]
)
def test_only_models_and_properties_of_the_folder_are_files(
    user: Client, folder: Path, name: str
) -> None:
    for question in ("read", "write", "rename", "delete"):
        answer = ask(user, question, name=name, text="x", version="", new="new.pm")
        assert "is no name of a model" in answer["error"]["message"]
    answer = ask(user, "rename", name="walk.nm", new=name)
    assert "is no name of a model" in answer["error"]["message"]
    assert (folder / "walk.nm").exists()
    assert not (folder.parent / "x.pm").exists()


def test_a_file_is_renamed_to_a_free_name_only(user: Client, folder: Path) -> None:
    assert ask(user, "rename", name="walk.nm", new="new.nm") == {}
    assert (folder / "new.nm").read_text() == MODEL
    taken = ask(user, "rename", name="new.nm", new="grid.pm")["error"]["message"]
    assert "'grid.pm' exists already" in taken
    assert (folder / "grid.pm").read_text() == GRID
    gone = ask(user, "rename", name="walk.nm", new="third.nm")["error"]["message"]
    assert "there is no file 'walk.nm'" in gone
    assert not (folder / "third.nm").exists()


def test_a_compressed_file_keeps_its_ending(tmp_path: Path) -> None:
    (tmp_path / "m.prism.gz").write_bytes(gzip.compress(MODEL.encode()))
    project = Project(tmp_path, ("m.prism.gz",))
    with pytest.raises(UsageError, match="is not compressed as"):
        project.rename("m.prism.gz", "n.prism")
    assert project.read("m.prism.gz").text == MODEL


def test_only_the_version_that_was_seen_is_deleted(user: Client, folder: Path) -> None:
    file = ask(user, "read", name="walk.nm")
    (folder / "walk.nm").write_text("theirs")
    assert ask(user, "delete", name="walk.nm", version=file["version"])["error"]["newer"]
    version = ask(user, "read", name="walk.nm")["version"]
    assert ask(user, "delete", name="walk.nm", version=version) == {}
    assert not (folder / "walk.nm").exists()
    (folder / "folder.nm").mkdir()
    answer = ask(user, "delete", name="folder.nm", version="")
    assert "there is no file 'folder.nm'" in answer["error"]["message"]
    (folder / "folder.nm").rmdir()


def test_a_file_that_is_no_text_stays(user: Client, folder: Path) -> None:
    (folder / "walk.nm").write_bytes(b"\xff\xfe")
    assert "no text in UTF-8" in ask(user, "read", name="walk.nm")["error"]["message"]
    assert "error" in ask(user, "write", name="walk.nm", text="x", version="")
    assert (folder / "walk.nm").read_bytes() == b"\xff\xfe"


@pytest.mark.parametrize(
    "body", ["", "[]", "{", "null", '{"name": 1}', '{"names": 3}', '{"at": {}}']
)
@pytest.mark.parametrize(
    "name",
    [
        *("read", "write", "rename", "delete", "versions"),
        *("analysis", "hover", "completions", "formatted"),
    ],
)
def test_a_wrong_question_is_answered(user: Client, folder: Path, name: str, body: str) -> None:
    answer = user.post(f"/api/{name}", content=body, headers=user.own)
    assert "error" in answer.json()
    assert (folder / "walk.nm").read_text() == MODEL


# ----------------------------------------------------------------------------------------- language


def test_faults_are_placed_in_the_units_of_browsers(user: Client) -> None:
    text = MODEL + '// 𝒳 ü\nlabel "q" = y=1;'
    found = ask(user, "analysis", **{**TEXTS, "model": text})
    (fault,) = found["model"]["faults"]
    units = text.encode("utf-16-le")
    assert units[2 * fault["from"] : 2 * fault["to"]].decode("utf-16-le") == "y"
    assert found["constants"] == [{"name": "N", "type": "int"}]
    assert [p["text"] for p in found["list"]] == ['Pmin=? [ F "done" ]', 'P>=0.9 [ F "done" ]']


def test_fixes_are_placed_in_the_units_of_browsers(user: Client) -> None:
    text = MODEL + '// 𝒳 ü\nlabel "q" = los;'
    (fault,) = ask(user, "analysis", **{**TEXTS, "model": text})["model"]["faults"]
    (fix,) = fault["fixes"]
    units = text.encode("utf-16-le")
    assert units[2 * fix["from"] : 2 * fix["to"]].decode("utf-16-le") == "los"
    assert (fix["title"], fix["text"]) == ("Change to 'lost'", "lost")


def test_an_empty_model_has_no_faults(user: Client) -> None:
    found = ask(user, "analysis", **{**TEXTS, "model": " \n"})
    assert found["model"]["faults"] == []
    assert "a model" in run(user, do="build", model="")[-1]["error"]["message"]


def test_help_and_completions(user: Client) -> None:
    at = PROPERTIES.index("done") + 1
    assert 'label "done"' in ask(user, "hover", **TEXTS, part="properties", at=at)["text"]
    at = MODEL.index("!lost") + 1
    items = ask(user, "completions", **TEXTS, part="model", at=at)["items"]
    assert {"label": "lost", "type": "variable"}.items() <= next(
        i.items() for i in items if i["label"] == "lost"
    )


# --------------------------------------------------------------------------------------------- jobs


def test_a_check_gives_value_accuracy_and_bounds(user: Client) -> None:
    found = run(user, do="check", property='Pmin=? [ F "done" ]')[-1]["result"]
    low, high = json.loads(found["bounds"])
    assert low <= 0.75**2 <= high
    assert found["accuracy"] == "exact up to rounding"
    assert run(user, do="check", property='P>=0.9 [ F "done" ]')[-1]["result"]["holds"] is False
    gone = run(user, do="check", property="P=? [ F x=1 ]")[-1]["error"]
    assert "the properties have changed" in gone["message"]


def test_options_are_those_of_the_library(user: Client) -> None:
    asked = {"do": "check", "property": 'Pmin=? [ F "done" ]'}
    assert run(user, **asked, options={"engine": "exact"})[-1]["result"]["value"] == "9/16"
    wrong = run(user, **asked, options={"epsilon": "much"})[-1]["error"]["message"]
    assert wrong == "epsilon: 'much' is not a number"
    some = {"symmetry": "true", "threads": "1", "order": "sift", "time_limit": "10"}
    assert float(run(user, **asked, options=some)[-1]["result"]["value"]) == pytest.approx(9 / 16)
    assert "no option" in run(user, **asked, options={"ltl2da": "rm"})[-1]["error"]["message"]


def test_an_estimate_has_the_confidence_that_was_asked_for(user: Client) -> None:
    asked = {"do": "estimate", "property": 'Pmin=? [ F "done" ]'}
    plan = {"samples": "500", "error": "0.1", "seed": "3", "method": "aci"}
    found = run(user, **asked, sampling=plan)[-1]["result"]
    assert "with probability about 0.9, 500 samples" in found["accuracy"]
    assert (found["sampled"], found["explains"]) == (True, False)
    assert found == {
        **run(user, **asked, sampling=plan)[-1]["result"],
        "seconds": found["seconds"],
    }
    for plan, message in (
        ({"method": "best"}, "method: 'best' is none of ci, aci, apmc, sprt"),
        ({"width": "-1"}, "width: '-1' is not a positive number"),
        ({"error": "2"}, "error: '2' is not a number between 0 and 1"),
        ({"samples": "0"}, "expected a whole number from 1"),
        ({"paths": "1"}, "there is no setting 'paths'"),
    ):
        assert message in run(user, **asked, sampling=plan)[-1]["error"]["message"]


def test_an_mdp_has_no_distribution(user: Client) -> None:
    error = run(user, do="distribution", time="")[-1]["error"]["message"]
    assert "an MDP has no steady-state distribution" in error


def test_a_distribution_in_rational_arithmetic_has_fractions(user: Client) -> None:
    asked = {"model": "dtmc module m x:[0..2]; [] x=0 -> 1/3:(x'=1)+2/3:(x'=2); endmodule"}
    asked |= {"properties": "", "constants": {}, "options": {"engine": "exact"}}
    found = run(user, do="distribution", time="1", **asked)[-1]["result"]
    assert found["rows"] == [["2", "2/3"], ["1", "1/3"]]
    assert "exact" in found["about"]
    text = run(user, do="distribution", time="1", all=True, **asked)[-1]["result"]["csv"]
    assert text.splitlines()[0] == "state,x,probability"


def test_an_error_of_a_job_has_its_place(user: Client) -> None:
    faulty = MODEL.replace("0.75", "0.7")
    error = run(user, do="build", model=faulty)[-1]["error"]
    (fault,) = error["faults"]["model"]
    assert "0.7" in faulty[fault["from"] : fault["to"]]


def test_an_experiment_tells_its_rows_one_by_one(user: Client) -> None:
    job = {"do": "experiment", "constants": {"N": "1:2:5"}, "property": 'Pmin=? [ F "done" ]'}
    *told, last = run(user, **job)
    rows = [row for message in told for row in message.get("rows", ())]
    assert [row["constants"] for row in rows] == [{"N": "1"}, {"N": "3"}, {"N": "5"}]
    assert [row["numbers"][0] for row in rows] == pytest.approx([0.75, 0.75**2, 0.75**3])
    assert last["result"]["csv"].startswith("property,N,value")


@pytest.mark.parametrize(
    ("worker", "job"),
    [
        ("check", {"do": "build"}),
        ("check", {"do": "distribution", "time": "0"}),
        ("simulate", {"do": "start"}),
        ("draw", {"do": "page", "states": 9}),
        ("draw", {"do": "export", "kind": "tra"}),
    ],
    ids=lambda given: given if isinstance(given, str) else given["do"],
)
def test_faults_of_properties_do_not_concern_the_model(
    user: Client, worker: str, job: dict[str, object]
) -> None:
    model = {"model": WAITING, "constants": {"of_properties": "1"}}
    assert "result" in run(user, worker, properties="P=? [ F x=", **model, **job)[-1]
    wrong = {**model, "model": WAITING + " faulty"}
    assert "error" in run(user, worker, properties="P=? [ F x=", **wrong, **job)[-1]


ONE_FAULTY = PROPERTIES + 'P>0 [ F x= ];\n"most": Pmax=? [ F "done" ];\n'


def test_a_faulty_property_has_its_fault_and_the_others_have_values(user: Client) -> None:
    listed = ask(user, "analysis", **{**TEXTS, "properties": ONE_FAULTY})["list"]
    assert [p["name"] or p["text"] for p in listed] == [
        *("least", 'P>=0.9 [ F "done" ]', "P>0 [ F x= ]", "most"),
    ]
    assert [ONE_FAULTY[p["at"] :].split()[0] for p in listed] == [
        '"least":',
        "P>=0.9",
        "P>0",
        '"most":',
    ]
    faults = [p.get("fault", "") for p in listed]
    assert [bool(fault) for fault in faults] == [False, False, True, False]
    assert faults[2].startswith("walk.props:3:12: error[syntax]: unexpected ']'")
    asked = {"do": "check", "properties": ONE_FAULTY, "property": listed[3]["text"]}
    assert run(user, **asked)[-1]["result"]["value"] == "1.0"


def test_an_experiment_leaves_faulty_properties_out(user: Client) -> None:
    asked = {"do": "experiment", "properties": ONE_FAULTY, "property": None}
    table = run(user, constants={"N": "3:4"}, **asked)[-1]["result"]["csv"]
    assert len(table.splitlines()) == 1 + 3 * 2


def test_a_jani_file_has_all_properties_or_is_not_written(user: Client) -> None:
    told = run(user, "draw", do="export", kind="jani", properties=ONE_FAULTY)[-1]["error"]
    assert told["message"].startswith("walk.props:3:12")
    assert len(told["faults"]["properties"]) == 1


WAITING = "dtmc module m x:[0..3]; [] true -> 0.5 : (x'=0) + 0.5 : (x'=1); endmodule"


def test_a_path_grows_and_shrinks(user: Client) -> None:
    assert "no path" in run(user, "explore", do="move", move="step")[-1]["error"]["message"]
    start = run(user, "simulate", do="start", seed="3")[-1]["result"]
    assert (start["length"], len(start["rows"]), start["seed"]) == (1, 1, 3)
    step = run(user, "simulate", do="move", move="step", choice=1, branch=0)[-1]["result"]
    assert (step["length"], step["state"]) == (2, "x=2 & lost=false")
    back = run(user, "simulate", do="move", move="back")[-1]["result"]
    assert (back["length"], back["rows"]) == (1, [])


def test_going_back_to_a_step_twice_goes_there_once(user: Client) -> None:
    run(user, "simulate", do="start", seed="3", model=WAITING)
    run(user, "simulate", do="move", move="run", steps="20")
    for _ in range(2):
        back = run(user, "simulate", do="move", move="back", to=7)[-1]["result"]
        assert (back["length"], back["rows"]) == (8, [])


@pytest.mark.parametrize("seed", ["abc", "-1", "1.5"])
def test_a_seed_is_a_whole_number(user: Client, seed: str) -> None:
    told = run(user, "simulate", do="start", seed=seed)[-1]["error"]["message"]
    assert told.startswith("seed: ")


def test_faults_are_underlined_after_a_file_was_renamed(user: Client) -> None:
    text = "dtmc module m x:[0..3]; [] x<4 -> (x'=x+1); endmodule"
    for name in ("a.prism", "b.prism"):
        answer = run(user, "explore", do="explore", model=text, model_name=name)[-1]["error"]
        assert answer["faults"]["model"]
        assert answer["message"].startswith(f"{name}:")


@pytest.mark.parametrize(
    "kind", ["tra", "sta", "lab", "srew", "trew", "pexp", "dot", "drn", "jani"]
)
def test_each_export_has_a_text(user: Client, kind: str) -> None:
    files = run(user, "draw", do="export", kind=kind)[-1]["result"]["files"]
    assert list(files) == [f"model.{kind}"]
    assert files[f"model.{kind}"]


def test_a_killed_worker_leaves_the_workbench_alive(user: Client, folder: Path) -> None:
    workers = user.served.app.state.workers

    job = {**TEXTS, "model": GRID, "properties": FOREVER, "constants": {}}
    job |= {"do": "check", "property": FOREVER.strip("; \n")}
    with user.stream("POST", "/job/check", json=job, headers=user.own) as answer:
        lines = answer.iter_lines()
        next(lines)
        killed = workers["check"].process.pid
        os.kill(killed, signal.SIGKILL)
        *_, last = lines
    assert "was ended" in json.loads(last)["error"]["message"]
    found = run(user, do="check", property='P>=0.9 [ F "done" ]')[-1]["result"]
    assert found["holds"] is False
    assert workers["check"].process.pid != killed
    assert (folder / "walk.nm").read_text() == MODEL


@pytest.mark.parametrize("job", [{"do": "none"}, {}, {"do": "check"}, {"do": "check", "model": 3}])
def test_a_wrong_job_leaves_its_worker_alive(user: Client, job: dict[str, object]) -> None:
    answer = user.post("/job/check", json=job, headers=user.own).text
    assert "error" in json.loads(answer.splitlines()[-1])
    assert "result" in run(user, do="build")[-1]


# ------------------------------------------------------------------------------------------ command


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a.pm", "b.pctl", "c"], "unrecognized arguments: c"),
        (["a/m.pm", "b/m.pctl"], "have to stand in one folder"),
        (["--port", "99999"], "cannot use 99999"),
        (["m.jani"], "edits models in the PRISM language, not JANI"),
    ],
)
def test_a_wrong_command_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        serve(words)


def test_warnings_of_a_model_are_told(user: Client) -> None:
    text = "dtmc module m x:[0..3]; [] x<3->(x'=x+1); [] x<2->(x'=0); endmodule"
    asked = {"model": text, "properties": "P=? [ F x=3 ]", "constants": {}}
    for job in ({"do": "build"}, {"do": "check", "property": "P=? [ F x=3 ]"}):
        warnings = run(user, **{**asked, **job})[-1]["result"]["warnings"]
        assert ["fair coin" in w for w in warnings] == [True, False]
        assert warnings[1] == "deadlocks were given self-loops in 1 state, such as (x=3)"
    found = run(user, **asked, do="explore")[-1]["result"]
    assert [f["severity"] for f in found["faults"]] == ["warning"]
    assert "(x=3)" in found["about"]


def test_constants_of_properties_are_exported(user: Client) -> None:
    asked = {"properties": 'const int k; Pmax=? [ F<=k "done" ]', "constants": {"N": "2", "k": "3"}}
    (text,) = run(user, do="export", kind="jani", **asked)[-1]["result"]["files"].values()
    assert len(json.loads(text)["properties"]) == 1
