"""Socket between measuring and serving process, for reports, questions and answers.

Each message is preceded by its length as four bytes, most significant first. Messages of the
measuring process are pickled values of this program; it is the trusted side. Messages of the
serving process, which talks to the network, are JSON and are validated.
"""

import asyncio
import pickle
import struct
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import structlog
from pydantic import TypeAdapter, ValidationError

from service.live.commands import CommandFailedError, OperatorCommand, encoded
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.audit_entries import acting
from service.store.sharing import Answer

log = structlog.get_logger()

LENGTH = struct.Struct(">I")

MAX_QUESTION_BYTES = 1_000_000
MAX_REPORT_BYTES = 256_000_000

MAX_QUESTIONS = 8
"""Maximum number of questions that are answered at the same time; further ones wait."""

ANSWER_WITHIN_S = 25.0
"""Maximum wait for an answer, s; storing a command may take ten seconds twice."""


TAKEN_WITHIN_S = 30.0
"""Maximum wait for a serving process that does not read reports, s; then it counts as hanging."""


class MeasuringGoneError(Exception):
    """Error raised if the measuring process did not answer, returned an error, or has ended."""


class VersionError(Exception):
    """Error raised if the two processes are of different versions of padwatch."""


@dataclass(frozen=True)
class Question:
    """Question or command of the serving process to the measuring process.

    Parameters
    ----------
    number
        Number of the question, repeated in its answer.
    kind, document
        Kind of question, and its arguments as JSON; see `service.live.commands`.
    actor, peer
        User and network address of the request; empty and None if the process itself asks.
    """

    number: int
    kind: str
    document: str
    actor: str
    peer: str | None


@dataclass(frozen=True)
class Reply:
    """Answer to the question with a number: its value, or an error message and None as value."""

    number: int
    value: Any
    error: str | None


_QUESTION = TypeAdapter(Question)


async def _read(reader: asyncio.StreamReader, max_bytes: int) -> bytes | None:
    """Return the next message, or None at the end; raise `ValueError` for one that is too long."""
    try:
        (n_bytes,) = LENGTH.unpack(await reader.readexactly(LENGTH.size))
        if n_bytes > max_bytes:
            raise ValueError(f"a message has {n_bytes} bytes; at most {max_bytes} are accepted")
        return await reader.readexactly(n_bytes)
    except (asyncio.IncompleteReadError, ConnectionError):
        return None


async def _write(writer: asyncio.StreamWriter, content: bytes) -> None:
    if writer.is_closing():  # uvloop raises RuntimeError
        raise ConnectionResetError("the connection is closed")
    writer.writelines((LENGTH.pack(len(content)), content))
    await writer.drain()


@dataclass(frozen=True)
class Start:
    """Plant and options with which the serving process starts.

    With `is_demo`, local clients have the admin role without a login.
    """

    plant: PlantFile
    origin: Origin
    is_demo: bool


def write_start(writer: asyncio.StreamWriter, start: Start) -> None:
    """Write the version of padwatch and the start options, without waiting for the reader."""
    content = version("padwatch").encode() + b"\n" + pickle.dumps(start, pickle.HIGHEST_PROTOCOL)
    writer.writelines((LENGTH.pack(len(content)), content))


async def read_start(reader: asyncio.StreamReader) -> Start:
    """Read and return the start options that `write_start` wrote.

    Raises `VersionError` if the measuring process is of another version, and `MeasuringGoneError`
    if it has ended.
    """
    if (content := await _read(reader, MAX_REPORT_BYTES)) is None:
        raise MeasuringGoneError("the measuring process has ended")
    theirs, _, pickled = content.partition(b"\n")
    if (own := version("padwatch").encode()) != theirs:
        raise VersionError(
            f"the serving process is padwatch {own.decode()}, the measuring process padwatch"
            f" {theirs.decode()}: restart padwatch"
        )
    start: Start = pickle.loads(pickled)  # noqa: S301  own parent
    return start


@dataclass
class MeasuringEnd:
    """Measuring process's end of the socket, which sends reports and answers questions.

    Parameters
    ----------
    report
        Function that returns a report on changes since the last call; the argument is True at the
        first call on a connection, for a complete report.
    answer
        Function that returns the answer to a question.
    period_s
        Time between two calls of `report`, s.
    """

    report: Callable[[bool], object]
    answer: Callable[[Question], Awaitable[object]]
    period_s: float

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Send reports and answers until the other end closes the connection or stops reading."""
        answering: set[asyncio.Task[None]] = set()
        places = asyncio.Semaphore(MAX_QUESTIONS)
        reporting = asyncio.create_task(self._report_on(writer), name="report")
        reporting.add_done_callback(lambda _: writer.transport.abort())
        try:
            while (content := await _read(reader, MAX_QUESTION_BYTES)) is not None:
                question = _QUESTION.validate_json(content)
                await places.acquire()
                task = asyncio.create_task(self._reply(writer, question), name="answer")
                answering.add(task)
                task.add_done_callback(answering.discard)
                task.add_done_callback(lambda _: places.release())
        except (ValueError, ValidationError) as error:
            log.error("a message of the serving process is refused", reason=str(error))
        finally:
            reporting.cancel()
            await asyncio.gather(reporting, *answering, return_exceptions=True)
        if not reporting.cancelled():
            reporting.result()  # raises the error of a failed report

    async def _report_on(self, writer: asyncio.StreamWriter) -> None:
        is_first = True
        while True:
            # a slow reader delays the next report, which then has all changes
            content = pickle.dumps(self.report(is_first), pickle.HIGHEST_PROTOCOL)
            try:
                async with asyncio.timeout(TAKEN_WITHIN_S):
                    await _write(writer, content)
            except TimeoutError:
                log.error("the serving process does not read reports; it is restarted")
                return
            except ConnectionError:
                return  # it has ended
            is_first = False
            await asyncio.sleep(self.period_s)

    async def _reply(self, writer: asyncio.StreamWriter, question: Question) -> None:
        try:
            reply = Reply(question.number, await self.answer(question), None)
        except Exception as error:
            log.exception("a question of the serving process failed", kind=question.kind)
            reply = Reply(question.number, None, str(error) or type(error).__name__)
        try:
            await _write(writer, pickle.dumps(reply, pickle.HIGHEST_PROTOCOL))
        except ConnectionError:
            log.warning("the serving process ended before an answer", kind=question.kind)


class ServingEnd:
    """Serving process's end of the socket, which receives reports and asks questions."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._n_asked = 0

    async def run(
        self, reader: asyncio.StreamReader, take: Callable[[Any], Awaitable[None]]
    ) -> None:
        """Receive reports and answers until the measuring process closes the socket.

        `take` is called with each report.
        """
        try:
            while (content := await _read(reader, MAX_REPORT_BYTES)) is not None:
                message = pickle.loads(content)  # noqa: S301  written by the trusted side
                if isinstance(message, Reply):
                    self._settle(message)
                else:
                    await take(message)
        finally:
            for future in (each for each in self._waiting.values() if not each.done()):
                future.set_exception(MeasuringGoneError("the measuring process has ended"))
            self._waiting.clear()

    def _settle(self, reply: Reply) -> None:
        future = self._waiting.pop(reply.number, None)
        if future is None or future.done():
            return  # the caller no longer waits
        if reply.error is None:
            future.set_result(reply.value)
        else:
            future.set_exception(MeasuringGoneError(reply.error))

    async def ask(self, kind: str, document: str, actor: str = "", peer: str | None = None) -> Any:
        """Ask the measuring process a question, `kind` with `document` in JSON; return its answer.

        `actor` and `peer` are the user and the network address of the request, if there is one.
        Raises `MeasuringGoneError` if the answer is an error, or does not arrive within
        `ANSWER_WITHIN_S` seconds.
        """
        self._n_asked += 1
        number = self._n_asked
        question = Question(number, kind, document, actor, peer)
        future = self._waiting[number] = asyncio.get_running_loop().create_future()
        try:
            await _write(self._writer, _QUESTION.dump_json(question))
            async with asyncio.timeout(ANSWER_WITHIN_S):
                return await future
        except TimeoutError as error:
            detail = f"the measuring process has not answered within {ANSWER_WITHIN_S:g} s"
            raise MeasuringGoneError(detail) from error
        except ConnectionError as error:
            raise MeasuringGoneError("the measuring process has ended") from error
        finally:
            self._waiting.pop(number, None)

    async def send(self, unit: str, command: OperatorCommand, actor: str) -> Answer:
        """Send a command of the user `actor` about a unit; return the answer.

        Raises `CommandFailedError` if there is no answer.
        """
        try:
            answer: Answer = await self.ask(*encoded(command), actor, acting().peer)
        except MeasuringGoneError as error:
            detail = f"unit {unit}: {error}; check whether the command was carried out"
            raise CommandFailedError("No answer", detail) from error
        return answer
