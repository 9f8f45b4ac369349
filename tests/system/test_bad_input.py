"""What is sent to the real service to break it ends in the right 4xx, and costs it nothing."""

import csv
import io
import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import httpx2
import psutil
import pytest
from rigs.command_line import padwatch

PATIENCE_S = 90.0
MIB = 1024 * 1024
MOST_GROWTH = 64 * MIB

COMMENT = "/api/v1/alarms/U1:link:link_lost/comment"
TRENDS = "/api/v1/units/U1/bearings/UJB/trends"
GOOD = {"quantity": "speed_rpm", "start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")
NASTY = [
    "'; DROP TABLE assessment; --",
    '<script>alert("1")</script>',
    '=HYPERLINK("http://evil.example")',
    *("+1+cmd|' /C calc'!A0", "-2+3", "@SUM(A1:A9)"),
    "{{7*7}} ${7*7} %s %n {0.__class__}",
]


@dataclass
class Service:
    """A running service that has no DAQ."""

    process: "subprocess.Popen[str]"
    log: Path
    url: str = field(init=False)

    def __post_init__(self) -> None:
        line = self.process.stdout.readline() if self.process.stdout else ""
        self.url = line.removeprefix("padwatch: ").strip().rstrip("/")
        assert self.url.startswith("http://127.0.0.1:"), self.log.read_text(encoding="utf-8")

    def client(self) -> httpx2.Client:
        return httpx2.Client(base_url=self.url, trust_env=False, timeout=PATIENCE_S)

    def connection(self) -> socket.socket:
        port = int(self.url.rpartition(":")[2])
        return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)

    def says(self, request: bytes) -> bytes:
        """The whole answer to a raw request, until the connection is closed."""
        with closing(self.connection()) as connection:
            connection.sendall(request)
            return b"".join(iter(lambda: connection.recv(65536), b""))

    def post(self, path: str, body: bytes, **headers: str) -> httpx2.Response:
        with self.client() as client:
            sent = {"Content-Type": "application/json", **headers}
            return client.post(path, content=body, headers=sent)

    @property
    def memory(self) -> int:
        return int(psutil.Process(self.process.pid).memory_info().rss)


@pytest.fixture(scope="module")
def service(
    tmp_path_factory: pytest.TempPathFactory, write_plant: Callable[..., Path]
) -> Iterator[Service]:
    """One service for all; whatever came, it has said no traceback and ends as it should."""
    folder = tmp_path_factory.mktemp("service")
    plant = write_plant(folder)
    log = folder / "service.log"
    with log.open("w", encoding="utf-8") as errors:
        command = [sys.executable, "-m", "service.cli.main", "run", str(plant), "--port", "0"]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder
        )
    with process:
        try:
            running = Service(process, log)
            yield running
            with running.client() as client:
                assert client.get("/livez").json()["status"] == "ok"
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0
            assert "Traceback" not in log.read_text(encoding="utf-8")
        finally:
            process.kill()


def refused(answer: httpx2.Response, status: int) -> str:
    """The words of a refusal, which is a problem document."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert (problem["status"], "Traceback" in answer.text) == (status, False)
    return str(problem["detail"])


@pytest.mark.parametrize("is_chunked", [False, True])
def test_two_hundred_mebibytes_and_chunks_without_end_cost_no_memory(
    service: Service, is_chunked: bool
) -> None:
    before = service.memory
    length = b"Transfer-Encoding: chunked" if is_chunked else b"Content-Length: %d" % (200 * MIB)
    piece = b"%x\r\n%s\r\n" % (MIB, b"a" * MIB) if is_chunked else b"a" * MIB
    most = before
    with closing(service.connection()) as connection:
        head = f"POST {COMMENT} HTTP/1.1\r\nHost: localhost\r\n".encode()
        connection.sendall(head + length + b"\r\n\r\n" + piece)
        answer = connection.recv(65536)  # before a reset could take it away
        for _ in range(199):
            try:
                connection.sendall(piece)
            except ConnectionError:
                break
            most = max(most, service.memory)

    assert answer.startswith(b"HTTP/1.1 413 ")
    assert most - before < MOST_GROWTH


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"text": "\xff\xfe"}', 400),
        (b"[" * 100_000 + b"]" * 100_000, 413),
        (b"[" * 20_000 + b"]" * 20_000, 400),
        (b'{"text": NaN}', 422),
        (b'{"text": "a", "actor": Infinity}', 422),
        (b'{"text": 1e999}', 422),
        (b'{"text": "a"', 422),
        (b'{"text": "\\ud800"}', 422),
        (b'{"text": "a\\u0000b"}', 422),
        (b'{"text": "a", "text2": "b"}', 422),
        *((b"", 422), (b"null", 422)),
        *(
            (b'{"actor": "A. Name", "reason": "none", "duration_s": %s}' % number, 422)
            for number in (b"NaN", b"Infinity", b"-Infinity", b"1e999")
        ),
    ],
)
def test_a_body_that_is_no_request_is_refused(service: Service, body: bytes, status: int) -> None:
    path = COMMENT.replace("comment", "shelve") if b"duration_s" in body else COMMENT

    refused(service.post(path, body), status)


@pytest.mark.parametrize(
    "asked",
    [
        {"start": "2026-02-01T00:00:00Z", "end": "2026-01-01T00:00:00Z"},
        {"start": "2026-01-01T00:00:00Z", "end": "2026-01-01T00:00:00Z"},
        *({"start": "99999-01-01T00:00:00Z"}, {"start": "9" * 400}),
        *({"max_points": "1" + "0" * 30}, {"max_points": "-1"}),
        *({"eccentricity_min": "NaN"}, {"oil_temperature_max": "1e999"}),
        {"cursor": "9" * 40},
        {"quantity": "'; DROP TABLE assessment; --"},
        {"state": "' OR 1=1 --"},
    ],
)
def test_a_range_that_is_none_is_refused(service: Service, asked: dict[str, str]) -> None:
    with service.client() as client:
        assert client.get(TRENDS, params=GOOD).status_code == 200
        answer = client.get(TRENDS, params={**GOOD, **asked})

    refused(answer, 422)


def test_a_range_of_all_time_is_answered(service: Service) -> None:
    whole = {"start": "0001-01-01T00:00:00Z", "end": "9999-12-31T23:59:59Z"}
    with service.client() as client:
        answer = client.get(TRENDS, params={**GOOD, **whole})

    assert answer.status_code == 200


@pytest.mark.parametrize("unit", ["' OR '1'='1", "U1'; DROP TABLE alarm; --", "<script>", "\0"])
def test_a_name_with_code_in_it_is_unknown(service: Service, unit: str) -> None:
    with service.client() as client:
        refused(client.get("/api/v1/units/" + quote(unit, safe="")), 404)


@pytest.mark.parametrize("words", NASTY)
def test_words_with_code_in_them_stay_words(service: Service, words: str) -> None:
    body = json.dumps({"actor": words, "text": words}).encode()

    assert service.post(COMMENT, body).status_code == 200

    with service.client() as client:
        events = client.get("/api/v1/alarms/events").json()["events"]
        audit = client.get("/api/v1/audit")
    assert (events[0]["actor"], events[0]["reason"]) == (words, words)
    assert audit.headers["content-type"].startswith("application/json")
    assert audit.headers["x-content-type-options"] == "nosniff"
    assert audit.json()["entries"][0]["reason"] == words


@pytest.mark.parametrize("path", [TRENDS, "/api/v1/alarms/events", "/api/v1/audit"])
def test_no_cell_of_a_csv_file_is_a_formula(service: Service, path: str) -> None:
    for words in NASTY:
        service.post(COMMENT, json.dumps({"actor": words, "text": words}).encode())
    asked = {"format": "csv"} | (GOOD if path == TRENDS else {})
    with service.client() as client:
        answer = client.get(path, params=asked)
    cells = [cell for row in csv.reader(io.StringIO(answer.text)) for cell in row]

    assert answer.headers["content-type"].startswith("text/csv")
    assert (f"'{NASTY[2]}" in cells) == (path != TRENDS)
    number = re.compile(r"-?\d[\d.e+-]*")
    assert not [c for c in cells if c.startswith(FORMULA_STARTS) and not number.fullmatch(c)]


@pytest.mark.parametrize(
    "target",
    [
        "/static/../../../../etc/passwd",
        "/static/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "/static/..%2f..%2f..%2f..%2fetc%2fpasswd",
        "/static/%252e%252e%252fetc/passwd",
        "/static/..\\..\\etc\\passwd",
        *("/static//etc/passwd", "/static/%00", "//etc/passwd"),
        "/api/v1/recordings/..%2f..%2fpadwatch.sqlite3",
        "/api/v1/recordings/%2e%2e/files.zip",
        "/api/v1/alarms/..%2f..%2fetc:x:link_lost/evidence/1",
    ],
)
def test_no_path_leads_out(service: Service, target: str) -> None:
    request = f"GET {target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"

    head, _, body = service.says(request.encode()).partition(b"\r\n\r\n")

    assert head.split()[1] in (b"404", b"422"), head
    assert b"application/problem+json" in head
    assert b"root:" not in body
    assert b"SQLite" not in body


@pytest.mark.parametrize(
    "headers",
    [
        *({"Origin": "http://evil.example"}, {"Origin": "null"}),
        *({"Origin": "http://localhost.evil.example"}, {"Sec-Fetch-Site": "cross-site"}),
        {"Origin": "http://127.0.0.1:1"},
    ],
)
def test_a_page_of_another_site_changes_nothing(service: Service, headers: dict[str, str]) -> None:
    body = b'{"actor": "A. Name", "text": "from elsewhere"}'

    refused(service.post(COMMENT, body, **headers), 403)

    with service.client() as client:
        events = client.get("/api/v1/alarms/events").json()["events"]
    assert "from elsewhere" not in [event["reason"] for event in events]


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        *(("Host", host, 421) for host in ("evil.example", "localhost.evil.example", "10.0.0.1")),
        ("Host", "a" * 300, 421),
        ("Authorization", "Bearer x", 401),
        ("Authorization", "Bearer pw_" + "0" * 12 + "_" + "A" * 43, 401),
        ("Authorization", "Bearer " + "A" * 8000, 401),
        ("Authorization", "Bearer eyJhbGciOiJub25lIn0.eyJyb2xlIjoiYWRtaW4ifQ.", 401),
        ("Authorization", "Bearer pw_' OR 1=1 --", 401),
    ],
)
def test_a_foreign_name_and_a_forged_key_open_nothing(
    service: Service, name: str, value: str, status: int
) -> None:
    with service.client() as client:
        words = refused(client.get("/api/v1/units", headers={name: value}), status)

    assert name == "Host" or value not in words


def test_who_was_refused_a_change_stands_in_the_audit_trail(service: Service) -> None:
    refused(service.post(COMMENT, b'{"text": 1}'), 422)

    with service.client() as client:
        entries = client.get("/api/v1/audit", params={"limit": 1000}).json()["entries"]

    refusals = [entry for entry in entries if entry["action"] == "request.refused"]
    assert {entry["after"]["status"] for entry in refusals} >= {422}
    assert all(entry["object"].startswith("POST /api/v1/alarms/") for entry in refusals)


def test_a_second_service_on_the_same_data_is_refused_and_the_first_goes_on(
    service: Service,
) -> None:
    found = padwatch("run", service.log.with_name("plant.toml"), "--port", "0")

    assert found.exit_code == 1
    assert found.stderr.count("\n") == 1
    data = service.log.with_name("data")
    assert f"another padwatch (process {service.process.pid}) works with {data}" in found.stderr
    with service.client() as client:
        assert client.get("/api/v1/overview").json()["plant"]["name"]
