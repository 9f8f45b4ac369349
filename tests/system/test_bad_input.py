"""What is sent to the real service to break it ends in the right 4xx, and costs it nothing."""

import csv
import io
import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import httpx2
import pytest
from rigs.command_line import OPEN, padwatch

PATIENCE_S = 90.0

ALARMS = "/api/v1/alarms"
COMMENT = f"{ALARMS}/U1:link:link_lost/comment"
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
    client: httpx2.Client = field(init=False)

    def __post_init__(self) -> None:
        line = self.process.stdout.readline() if self.process.stdout else ""
        url = line.removeprefix("padwatch: ").strip().rstrip("/")
        assert url.startswith("http://127.0.0.1:"), self.log.read_text(encoding="utf-8")
        self.client = httpx2.Client(base_url=url, trust_env=False, timeout=PATIENCE_S)

    def says(self, request: bytes) -> bytes:
        """The whole answer to a raw request, until the connection is closed."""
        address = ("127.0.0.1", self.client.base_url.port or 0)
        with closing(socket.create_connection(address, timeout=PATIENCE_S)) as connection:
            connection.sendall(request)
            return b"".join(iter(lambda: connection.recv(65536), b""))

    def comment(self, body: bytes, **headers: str) -> httpx2.Response:
        sent = {"Content-Type": "application/json", **headers}
        return self.client.post(COMMENT, content=body, headers=sent)


@pytest.fixture(scope="module")
def service(
    tmp_path_factory: pytest.TempPathFactory, write_plant: Callable[..., Path]
) -> Iterator[Service]:
    """One service for all; whatever came, it has said no traceback and ends as it should."""
    folder = tmp_path_factory.mktemp("service")
    plant = write_plant(folder)
    log = folder / "service.log"
    with log.open("w", encoding="utf-8") as errors:
        command = [sys.executable, "-c", OPEN, "run", str(plant), "--port", "0"]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder
        )
    with process:
        try:
            running = Service(process, log)
            with running.client as client:
                yield running
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
    ],
)
def test_a_body_that_is_no_request_is_refused(service: Service, body: bytes, status: int) -> None:
    refused(service.comment(body), status)


def test_words_with_code_in_them_stay_words_and_are_no_formula_in_a_csv_file(
    service: Service,
) -> None:
    for words in NASTY:
        body = json.dumps({"actor": words, "text": words}).encode()
        assert service.comment(body).status_code == 200

    events = service.client.get(f"{ALARMS}/events").json()["events"]
    audit = service.client.get("/api/v1/audit")
    comments = [(event["actor"], event["reason"]) for event in events[: len(NASTY)]]
    assert comments == [(words, words) for words in reversed(NASTY)]
    assert audit.headers["content-type"].startswith("application/json")
    assert audit.headers["x-content-type-options"] == "nosniff"
    reasons = (entry["reason"] for entry in audit.json()["entries"])
    # what was refused of the tests before may be written down meanwhile
    assert [reason for reason in reasons if reason in NASTY] == NASTY[::-1]
    for path in (f"{ALARMS}/events", "/api/v1/audit"):
        table = service.client.get(path, params={"format": "csv"}).text
        cells = [cell for row in csv.reader(io.StringIO(table)) for cell in row]
        assert f"'{NASTY[2]}" in cells
        assert not [cell for cell in cells if cell.startswith(FORMULA_STARTS)]


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
    ("name", "value", "status"),
    [
        ("Origin", "http://localhost.evil.example", 403),
        ("Origin", "http://127.0.0.1:1", 403),
        ("Sec-Fetch-Site", "cross-site", 403),
        *(("Host", host, 421) for host in ("localhost.evil.example", "10.0.0.1", "a" * 300)),
        ("Authorization", "Bearer x", 401),
        ("Authorization", "Bearer pw_" + "0" * 12 + "_" + "A" * 43, 401),
        ("Authorization", "Bearer " + "A" * 8000, 401),
        ("Authorization", "Bearer eyJhbGciOiJub25lIn0.eyJyb2xlIjoiYWRtaW4ifQ.", 401),
        ("Authorization", "Bearer pw_' OR 1=1 --", 401),
    ],
)
def test_a_page_of_another_site_a_foreign_name_and_a_forged_key_change_nothing(
    service: Service, name: str, value: str, status: int
) -> None:
    body = b'{"actor": "A. Name", "text": "from elsewhere"}'

    words = refused(service.comment(body, **{name: value}), status)

    assert name != "Authorization" or value not in words
    events = service.client.get(f"{ALARMS}/events").json()["events"]
    assert "from elsewhere" not in [event["reason"] for event in events]


def test_a_second_service_on_the_same_data_is_refused_and_the_first_goes_on(
    service: Service,
) -> None:
    found = padwatch("run", service.log.with_name("plant.toml"), "--port", "0")

    assert found.exit_code == 1
    assert found.stderr.count("\n") == 1
    data = service.log.with_name("data")
    assert f"another padwatch (process {service.process.pid}) works with {data}" in found.stderr
    assert service.client.get("/api/v1/overview").json()["plant"]["name"]
