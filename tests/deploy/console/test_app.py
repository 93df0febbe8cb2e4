"""The console's doors: what is served to whom, and what is refused, each refusal with its words."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from common.clock import monotonic_ns, to_ns
from deploy.console.model.robot import TAP
from deploy.console.page_socket import LONGEST
from deploy.console.replies import COOKIE
from deploy.console.reports import ReportFolder
from deploy.console.session import SESSION_S, PageRole, Person
from deploy.console.study import StudyDesk
from deploy.console.viewers import KEPT, MESSAGES_PER_S, MOST
from deploy.examples import profiles
from deploy.study.marks import read_marks
from deploy.study.session import begin
from deploy.study.under_way import say_under_way
from tests.deploy.console.robots import ROBOT, frame, model, state
from tests.deploy.console.served import HeardStops, Served, cookie_jar, served

CUP = Path(profiles.__file__).parent / "study" / "cup.toml"
TLX = ("mental", "physical", "temporal", "performance", "effort", "frustration")
Story = Callable[[Served], Awaitable[None]]


def run(story: Story, stranger: PageRole = PageRole.VIEWER) -> None:
    async def told() -> None:
        async with served(stranger) as console:
            await story(console)

    asyncio.run(told())


@pytest.fixture
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    """The console's clock stands: rates do not depend on how fast this host is."""
    now_ns = monotonic_ns()
    for module in ("app", "page_socket"):
        monkeypatch.setattr(f"deploy.console.{module}.monotonic_ns", lambda: now_ns)


def test_the_pages_and_their_files_are_served_with_a_policy() -> None:
    async def story(console: Served) -> None:
        for path in ("/", "/engineer", "/study", "/calibrate"):
            async with console.http.get(console.url + path) as response:
                assert response.status == 200
                assert response.content_type == "text/html"
                assert "default-src 'self'" in response.headers["Content-Security-Policy"]
                assert response.headers["Content-Encoding"] == "gzip"
                tag = response.headers["ETag"]
            async with console.http.get(console.url + path, headers={"If-None-Match": tag}) as response:
                assert response.status == 304
        for path in ("/page/../app.py", "/page/%2e%2e/app.py", "/page/none.js", "/vendor/", "/other"):
            async with console.http.get(console.url + path) as response:
                assert response.status == 404, path

    run(story)


def test_setup_says_what_the_page_draws() -> None:
    async def story(console: Served) -> None:
        async with console.http.get(f"{console.url}/api/setup?robot=robot-2") as response:
            setup = await response.json()
        assert (setup["robot"], setup["robots"]) == ("robot-2", [ROBOT, "robot-2"])
        assert len(setup["joints"]) == 25
        async with console.http.get(f"{console.url}/api/setup?robot=robot-9") as response:
            assert response.status == 404

    run(story)


@pytest.mark.usefixtures("still")
def test_another_hosts_name_is_refused_everywhere(caplog: pytest.LogCaptureFixture) -> None:
    async def story(console: Served) -> None:
        for path in ("/", "/api/setup", "/ws"):
            async with console.http.get(console.url + path, headers={"Host": "evil.example"}) as response:
                assert response.status == 403
        assert console.access.refused == {"host": 3}
        assert len([line for line in caplog.messages if line.startswith("refused GET")]) == 1, "no flood"

    run(story)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1"])
def test_another_origin_neither_posts_nor_opens_a_socket(origin: str) -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        for path in ("/api/login", "/api/act", "/api/stop", "/api/logout"):
            status, said = await console.post(path, {}, Origin=origin)
            assert status == 403
            assert "may not use this console" in said["error"]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await console.page(Origin=origin)
        assert refused.value.status == 403
        assert console.access.refused == {"origin": 5}
        assert console.stops[ROBOT].by == []

    run(story)


def test_without_an_origin_nothing_is_posted() -> None:
    async def story(console: Served) -> None:
        async with console.http.post(f"{console.url}/api/stop", json={}) as response:
            assert response.status == 403

    run(story)


def test_a_form_of_another_page_is_no_json() -> None:
    async def story(console: Served) -> None:
        status, _ = await console.post("/api/stop", {}, **{"Content-Type": "text/plain"})
        assert status == 415

    run(story)


def test_a_token_logs_in_once_and_the_cookie_is_not_for_scripts() -> None:
    async def story(console: Served) -> None:
        token = console.access.issue(Person(PageRole.OPERATOR, "nurse-1"), monotonic_ns())
        sent = {"json": {"token": token}, "headers": console.origin}
        async with console.http.post(f"{console.url}/api/login", **sent) as response:  # type: ignore[arg-type]  # one call's arguments, used twice
            assert await response.json() == {"role": "operator", "person": "nurse-1"}
            cookie = response.headers["Set-Cookie"]
        assert cookie.startswith(f"{COOKIE}_{console.host.partition(':')[2]}=")
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        for wrong in (token, "guessed", ""):
            status, said = await console.post("/api/login", {"token": wrong})
            assert (status, "token" in said["error"]) == (403, True)
        assert console.access.refused == {"token": 3}

    run(story)


@pytest.mark.parametrize(
    ("person", "status"), [(None, 401), (Person(PageRole.VIEWER, "visitor"), 403)], ids=["stranger", "viewer"]
)
def test_only_operators_act_and_everybody_stops(person: Person | None, status: int) -> None:
    async def story(console: Served) -> None:
        if person is not None:
            await console.log_in(person)
        for act in ("engage", "disengage", "reset", "handover"):
            answered, said = await console.post("/api/act", {"act": act, "robot": ROBOT})
            assert (answered, "log in" in said["error"]) == (status, True)
        assert (await console.post("/api/stop", {"robot": ROBOT}))[0] == 202
        assert (await console.post("/api/act", {"act": "estop", "robot": ROBOT}))[0] == 202
        assert len(console.stops[ROBOT].by) == 2

    run(story)


@pytest.mark.parametrize(
    "body",
    [
        {"act": "dance"},
        {"act": "claim"},
        {"act": 5},
        {"act": "engage", "robot": "robot-9"},
        {"act": "engage", "robot": 5},
        {"act": "rest"},
        {"act": "rest", "groups": "left_arm"},
        {"act": "rest", "groups": [5]},
        {"act": "reset"},
        {"act": "handover", "to": "x" * 200},
        [],
        "engage",
    ],
)
def test_what_is_no_act_is_refused_in_words(body: object) -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        status, said = await console.post("/api/act", body)
        assert (status, bool(said["error"])) == (400, True)

    run(story)


def test_a_session_that_expired_acts_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(console: Served) -> None:
        monkeypatch.setattr("deploy.console.session.SESSION_S", 0.0)
        await console.log_in()
        status, _ = await console.post("/api/act", {"act": "engage", "robot": ROBOT})
        assert status == 401

    run(story)


def test_a_log_out_ends_the_session() -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        assert (await console.post("/api/act", {"act": "engage"}))[0] == 503, "no link, but let in"
        await console.post("/api/logout", {})
        assert (await console.post("/api/act", {"act": "engage"}))[0] == 401

    run(story)


def test_a_long_body_is_refused() -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        status, _ = await console.post("/api/act", {"act": "engage", "key": "x" * 5000})
        assert status == 413
        assert console.access.refused == {"size": 1}

    run(story)


@pytest.mark.usefixtures("still")
def test_more_than_20_posts_a_second_are_refused() -> None:
    async def story(console: Served) -> None:
        statuses = [(await console.post("/api/login", {"token": "guess"}))[0] for _ in range(40)]
        assert statuses == [403] * 20 + [429] * 20
        stops = [(await console.post("/api/stop", {}))[0] for _ in range(30)]
        assert stops == [202] * 30, "what others send from this address takes the stop away from nobody"

    run(story)


@pytest.mark.usefixtures("still")
def test_a_flood_of_reads_is_refused_and_a_stop_in_it_is_heard() -> None:
    async def story(console: Served) -> None:
        statuses = []
        for _ in range(300):
            async with console.http.get(f"{console.url}/page/none.js") as response:
                statuses.append(response.status)
        assert statuses == [404] * 200 + [429] * 100
        assert (await console.post("/api/stop", {}))[0] == 202

    run(story)


def test_a_page_is_greeted_and_shown_the_robot() -> None:
    async def story(console: Served) -> None:
        showing = asyncio.create_task(console.hub.show())
        page = await console.page()
        hello = await page.hear("hello")
        assert (hello["role"], hello["robot"], hello["may"]["stop"], hello["may"]["act"]) == (
            "viewer", ROBOT, True, False
        )  # fmt: skip
        now_s = monotonic_ns() / 1e9
        console.models[ROBOT].on_state(state(at_s=now_s), monotonic_ns(), TAP)
        view = await page.hear("view")
        while view["heard"] == "none":
            view = await page.hear("view")
        assert (view["guard"], view["situation"]) == ("track", "follows")
        facts = await page.hear("facts")
        assert facts["viewers"] == [{"person": "viewer", "robot": ROBOT, "this": True}]
        await page.say(kind="robot", robot="robot-2")
        assert (await page.hear("hello"))["robot"] == "robot-2"
        showing.cancel()

    run(story)


def test_a_picture_has_its_header_before_it() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        await page.hear("hello")
        robot = console.models[ROBOT]
        robot.on_picture("head", frame(7, 200.0), monotonic_ns())
        console.hub.on_picture(robot, "head")
        data = await page.socket.receive_bytes(timeout=5.0)
        length = int.from_bytes(data[:4], "little")
        header = json.loads(data[4 : 4 + length])
        assert (header["kind"], header["camera"], header["number"], header["n"]) == ("picture", "head", 7, 1)
        assert data[4 + length :] == robot.pictures.newest["head"].frame.body

    run(story)


def test_anybody_stops_by_the_socket() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        await page.say(kind="stop", robot="robot-2")
        assert (await page.hear("answer"))["to"] == "stop"
        assert console.stops["robot-2"].by == ["console: viewer"]
        await page.say(kind="stop")
        await page.hear("answer")
        assert console.stops[ROBOT].by == ["console: viewer"], "the robot that the page shows"

    run(story)


def test_beyond_this_host_a_stranger_sees_nothing_and_may_stop() -> None:
    async def story(console: Served) -> None:
        showing = asyncio.create_task(console.hub.show())
        async with console.http.get(f"{console.url}/api/setup") as response:
            assert response.status == 401
        page = await console.page()
        assert (await page.hear("hello"))["role"] == "nobody"
        robot = console.models[ROBOT]
        robot.on_picture("head", frame(7, 200.0), monotonic_ns())
        console.hub.on_picture(robot, "head")
        await asyncio.sleep(0.1)
        await page.say(kind="stop")
        said = await page.socket.receive_json(timeout=5.0)
        assert said["kind"] == "answer", "neither a view nor a picture came before"
        showing.cancel()

    run(story, stranger=PageRole.NOBODY)


def test_the_ninth_page_is_told_so() -> None:
    async def story(console: Served) -> None:
        pages = [await console.page() for _ in range(MOST)]
        for page in pages:
            await page.hear("hello")
        ninth = await console.page()
        assert "8 pages are open" in (await ninth.hear("bye"))["why"]
        assert await ninth.closed() == aiohttp.WSCloseCode.TRY_AGAIN_LATER
        assert console.access.refused == {"viewers": 1}
        await pages[0].socket.close()
        while len(console.hub.pages) == MOST:  # noqa: ASYNC110
            await asyncio.sleep(0)
        await (await console.page()).hear("hello")

    run(story)


def test_strangers_do_not_take_all_places() -> None:
    async def story(console: Served) -> None:
        strangers = [await console.page() for _ in range(MOST)]
        await console.log_in()
        own = [await console.page() for _ in range(KEPT)]
        for page in strangers + own:
            await page.hear("hello")
        one_more = await console.page()
        assert "12 pages are open" in (await one_more.hear("bye"))["why"]

    run(story)


def test_a_long_message_ends_the_socket() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        await page.hear("hello")
        await page.say(kind="stop", robot="x" * LONGEST)
        assert await page.closed() == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
        while console.hub.pages:  # noqa: ASYNC110
            await asyncio.sleep(0)
        assert console.access.refused == {"size": 1}

    run(story)


@pytest.mark.parametrize("garbage", ["", "garbage", "[]", "5", "{", "[" * 4000])
def test_garbage_ends_the_socket_in_words(garbage: str) -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        await page.socket.send_str(garbage)
        assert "JSON" in (await page.hear("bye"))["why"]
        assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION

    run(story)


@pytest.mark.usefixtures("still")
def test_a_flood_of_requests_ends_the_socket_and_a_stop_in_it_is_heard() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        for _ in range(20):
            await page.say(kind="robot", robot=ROBOT)
        await page.say(kind="stop")
        await page.say(kind="robot", robot=ROBOT)
        assert "20 requests a second" in (await page.hear("bye"))["why"]
        assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
        assert console.stops[ROBOT].by == ["console: viewer"]

    run(story)


@pytest.mark.usefixtures("still")
def test_a_flood_of_acknowledgements_ends_the_socket() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        for _ in range(200):
            await page.say(kind="ack", n=1)
        assert "too many" in (await page.hear("bye"))["why"]

    run(story)


@pytest.mark.usefixtures("still")
def test_a_stop_is_heard_beyond_every_limit() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        for _ in range(int(MESSAGES_PER_S)):
            await page.say(kind="ack", n=1)
        await page.say(kind="stop")
        assert "too many" in (await page.hear("bye"))["why"]
        assert console.stops[ROBOT].by == ["console: viewer"]

    run(story)


def test_a_stop_without_a_robots_name_is_for_the_robot_that_is_shown() -> None:
    async def story(console: Served) -> None:
        assert (await console.post("/api/stop", {"robot": ""}))[0] == 202
        page = await console.page("robot-2")
        await page.say(kind="stop", robot="")
        await page.hear("answer")
        assert [len(each.by) for each in console.stops.values()] == [1, 1]
        assert (await console.post("/api/stop", {"robot": "robot-9"}))[0] == 400

    run(story)


class Listed:
    """Stands for the list, with one robot in it that is not open."""

    def __init__(self, console: Served) -> None:
        self._console = console

    def open(self, robot: str, to_stop: bool = False) -> str:
        if robot != "ward-3":
            return f"no robot {robot} is there"
        made = self._console.models[robot] = model(robot=robot)
        self._console.stops[robot] = HeardStops(made)
        return ""

    async def close_unseen(self, shown: object, now_ns: int) -> None:
        pass


@pytest.mark.parametrize("way", ["post", "socket"])
def test_a_stop_of_a_robot_of_the_list_opens_it(way: str) -> None:
    """It was closed while the page that shows it was away."""

    async def story(console: Served) -> None:
        listed: Any = Listed(console)
        console.hub.opened = listed
        if way == "post":
            assert (await console.post("/api/stop", {"robot": "ward-9"}))[0] == 400
            assert (await console.post("/api/stop", {"robot": "ward-3"}))[0] == 202
        else:
            page = await console.page()
            await page.say(kind="stop", robot="ward-3")
            assert (await page.hear("answer"))["done"]
        assert {robot: len(each.by) for robot, each in console.stops.items()} == {
            ROBOT: 0, "robot-2": 0, "ward-3": 1,
        }  # fmt: skip

    run(story)


def test_a_page_that_comes_back_shows_its_robot_or_says_that_it_shows_another() -> None:
    async def story(console: Served) -> None:
        listed: Any = Listed(console)
        console.hub.opened = listed
        assert (await (await console.page("ward-3")).hear("hello"))["robot"] == "ward-3"
        page = await console.page("ward-9")
        assert (await page.hear("hello"))["robot"] == ROBOT
        said = await page.hear("answer")
        assert (said["done"], said["text"]) == (
            False, f"ward-9: no robot ward-9 is there; this page shows {ROBOT}",
        )  # fmt: skip

    run(story)


def test_who_may_not_look_is_told_what_became_of_his_stop() -> None:
    async def story(console: Served) -> None:
        asking, other = await console.page(), await console.page()
        await asking.say(kind="stop")
        await asking.hear("answer")
        showing = asyncio.create_task(console.hub.show())
        assert (await asking.hear("stop"))["stop"]["robot_s"] is None
        stop = console.models[ROBOT].stop
        assert stop is not None
        stop.failed = "no answer"
        told = (await asking.hear("stop"))["stop"]
        assert told["failed"] == "no answer"
        assert told.keys() == {"asked_s", "robot_s", "stands_s", "failed", "since_s"}, "not by whom"
        await other.say(kind="dance")
        assert (await other.hear("hello"))["role"] == "nobody"
        assert (await other.socket.receive_json(timeout=5.0))["kind"] == "answer", "nothing of a stop before"
        showing.cancel()

    run(story, stranger=PageRole.NOBODY)


def test_a_page_whose_log_in_grew_too_old_sees_nothing_more() -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        page = await console.page()
        assert (await page.hear("hello"))["role"] == "operator"
        console.hub.refresh(monotonic_ns())
        console.hub.refresh(monotonic_ns() + to_ns(SESSION_S) + 1)
        assert (await page.hear("hello"))["role"] == "nobody"
        assert not console.hub.pages[0].person.role.sees

    run(story, stranger=PageRole.NOBODY)


def test_a_page_that_is_told_nothing_new_answers_what_it_does_not_know() -> None:
    async def story(console: Served) -> None:
        page = await console.page()
        await page.say(kind="dance")
        assert (await page.hear("answer"))["text"] == "no such message"
        await page.say(kind="stop", robot="robot-9")
        assert (await page.hear("answer"))["done"] is False
        await page.say(kind="held", n=1, down=True)
        assert "not the operator's deadman" in (await page.hear("answer"))["text"]

    run(story)


def test_a_page_that_stands_still_gets_no_past_and_delays_no_other() -> None:
    async def story(console: Served) -> None:
        showing = asyncio.create_task(console.hub.show())
        paused, lively = await console.page(), await console.page()
        robot = console.models[ROBOT]
        number = 0
        seen: list[int] = []
        while number < 60:
            view = await lively.hear("view")
            seen.append(view.get("state_n", 0))
            number += 1
            robot.on_state(state(number, at_s=monotonic_ns() / 1e9), monotonic_ns(), TAP)
        assert console.hub.pages[1].outbox.replaced == 0
        assert console.hub.pages[0].outbox.number == 8
        past = []
        while (view := await paused.hear("view")).get("state_n", 0) < number - 5:
            past.append(view["n"])
        assert 0 < len(past) <= 8, past
        showing.cancel()

    run(story)


def test_two_consoles_on_one_host_do_not_log_each_other_out() -> None:
    async def story() -> None:
        jar = cookie_jar()
        async with served(jar=jar) as one, served(jar=jar) as other:
            await one.log_in()
            await other.log_in()
            for console in (one, other):
                status, said = await console.post("/api/act", {"act": "mark", "robot": ROBOT})
                assert status == 200, said
            await other.post("/api/logout", {})
            assert (await one.post("/api/act", {"act": "mark", "robot": ROBOT}))[0] == 200
            assert (await other.post("/api/act", {"act": "mark", "robot": ROBOT}))[0] == 401

    asyncio.run(story())


def test_a_stop_that_would_end_with_the_console_is_not_called_certain() -> None:
    async def story(console: Served) -> None:
        console.stops[ROBOT].kept = False
        status, said = await console.post("/api/stop", {"robot": ROBOT})
        assert status == 503
        assert "use the switch at the robot" in said["error"]
        assert console.stops[ROBOT].by == ["console: viewer"], "it is asked for all the same"
        page = await console.page()
        await page.say(kind="stop")
        assert not (await page.hear("answer"))["done"]
        stop = console.models[ROBOT].stop
        assert stop is not None
        stop.robot_ns = monotonic_ns()
        assert (await console.post("/api/stop", {"robot": ROBOT}))[0] == 202, "the robot has acknowledged"

    run(story)


def test_a_study_is_led_by_who_may_act_and_its_marks_are_the_sessions(tmp_path: Path) -> None:
    async def story(console: Served) -> None:
        console.hub.desk = StudyDesk(tmp_path)
        await console.log_in()
        status, said = await console.post("/api/study", {"do": "next"})
        assert (status, "no session is under way" in said["error"]) == (409, True)
        session = begin(tmp_path, CUP, "k7pd")
        say_under_way(session)
        assert (await console.post("/api/study", {"do": "next"}))[1]["text"] == "step rest"
        said = (await console.post("/api/act", {"act": "mark", "robot": ROBOT, "text": "cup dropped"}))[1]
        assert said["text"] == "noted in session 01 of k7pd"
        given = {"do": "answers", "questionnaire": "nasa-tlx", "answers": {"mental": 50}}
        status, said = await console.post("/api/study", given)
        assert (status, "nasa-tlx, physical" in said["error"]) == (409, True)
        given["answers"] = dict.fromkeys(TLX, 30)
        assert (await console.post("/api/study", given))[1]["text"] == "kept; score 30"
        assert (await console.post("/api/study", {"do": "dance"}))[0] == 409
        page = await console.page()
        console.models[ROBOT].on_state(state(), monotonic_ns(), TAP)
        showing = asyncio.create_task(console.hub.show())
        shown = (await page.hear("facts"))["study"]
        showing.cancel()
        assert (shown["subject"], shown["step"]["name"], shown["next"]["name"]) == ("k7pd", "rest", "reach")
        assert shown["answered"] == [["rest", "nasa-tlx"]]
        assert (await console.post("/api/study", {"do": "end"}))[1]["done"]
        assert [mark.kind for mark in session.marks()] == ["step", "event", "answers", "end"]
        await console.post("/api/logout", {})
        assert (await console.post("/api/study", {"do": "next"}))[0] == 401

    run(story)


def test_a_mark_without_a_session_goes_to_this_hosts_recordings(tmp_path: Path) -> None:
    async def story(console: Served) -> None:
        await console.log_in()
        said = (await console.post("/api/act", {"act": "mark", "robot": ROBOT}))[1]
        assert "in no recording" in said["text"]
        console.hub.desk = StudyDesk(None, tmp_path)
        said = (await console.post("/api/act", {"act": "mark", "robot": ROBOT, "text": "x" * 128}))[1]
        assert said["text"] == "noted in this host's recordings"
        assert [mark.text for mark in read_marks(tmp_path)] == ["x" * 128]
        console.hub.desk = StudyDesk(None, tmp_path / "gone")
        assert (await console.post("/api/act", {"act": "mark", "robot": ROBOT}))[0] == 409

    run(story)


def test_reports_are_opened_from_the_page_without_their_scripts_and_nothing_beside_them(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "reports"
    (folder / "trial").mkdir(parents=True)
    (folder / "trial" / "report.html").write_text("<script>1</script>")
    (folder / "trial" / "lag.png").write_bytes(b"png")
    (folder / "secret.key").write_text("key")
    (tmp_path / "outside.html").write_text("outside")
    (folder / "link.html").symlink_to(tmp_path / "outside.html")

    async def story(console: Served) -> None:
        async with console.http.get(f"{console.url}/api/reports") as response:
            assert (await response.json())["reports"] == []
        console.hub.reports = ReportFolder(folder)
        async with console.http.get(f"{console.url}/api/reports") as response:
            found = (await response.json())["reports"]
        assert [one["path"] for one in found] == ["/reports/trial/report.html"]
        async with console.http.get(console.url + found[0]["path"]) as response:
            assert response.status == 200
            policy = response.headers["Content-Security-Policy"]
            assert "sandbox" in policy
            assert "default-src 'none'" in policy
        async with console.http.get(f"{console.url}/reports/trial/lag.png") as response:
            assert response.content_type == "image/png"
        for name in ("secret.key", "link.html", "../outside.html", "%2e%2e/outside.html", "trial", "none.md"):
            async with console.http.get(f"{console.url}/reports/{name}") as response:
                assert response.status == 404, name

    run(story)


def test_a_stranger_beyond_this_host_sees_no_report_and_no_question(tmp_path: Path) -> None:
    async def story(console: Served) -> None:
        console.hub.reports = ReportFolder(tmp_path)
        for path in ("/api/reports", "/reports/a.html", "/api/questionnaires"):
            async with console.http.get(console.url + path) as response:
                assert response.status == 401, path

    run(story, PageRole.NOBODY)
