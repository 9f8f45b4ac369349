"""Bodies: of a bounded size, complete, UTF-8, and not nested for ever."""

import tracemalloc

import pytest

MIB = 1024 * 1024


async def test_a_body_arrives_whole(running) -> None:
    client = await running.ask("/", "POST", "Transfer-Encoding: chunked\r\n")
    for _ in range(3):
        await client.send(b"4\r\nabcd\r\n")
    await client.send(b"0\r\n\r\n")

    assert await client.status() == 200
    assert client.body == b"12 bytes"


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"a": "\xff\xfe"}', 400),
        (b'{"a": "\xed\xa0\x80"}', 400),
        (b"[" * 30_000 + b"]" * 30_000, 400),
        (b'{"a":' * 17 + b"1" + b"}" * 17, 400),
        (b"[" * 16 + b"]" * 16, 200),
        (b'{"a": "' + b"[" * 30 + b'", "b": [1, {"c": []}]}', 200),
        (b'["\\"' + b"[" * 30 + b'"]', 200),
        (b'"' + b'\\"' * 30_000 + b'"', 200),  # made to be slow
        (b"]" * 9 + b"[" * 17, 200),
        (b"[" * 100_000 + b"]" * 100_000, 413),
        (b"a" * 64 * 1024, 200),
        (b"a" * (64 * 1024 + 1), 413),
    ],
)
async def test_a_bad_body_is_refused(running, body: bytes, status: int) -> None:
    client = await running.ask("/", "POST", f"Content-Length: {len(body)}\r\n")
    await client.send(body)

    assert await client.status() == status
    assert running.app.n_asked == (status == 200)


@pytest.mark.parametrize("is_chunked", [False, True])
async def test_two_hundred_mebibytes_cost_no_memory(running, is_chunked: bool) -> None:
    head = "Transfer-Encoding: chunked\r\n" if is_chunked else f"Content-Length: {200 * MIB}\r\n"
    piece = b"%x\r\n%s\r\n" % (MIB, b"a" * MIB) if is_chunked else b"a" * MIB
    client = await running.ask("/", "POST", head)
    tracemalloc.start()
    try:
        for _ in range(200):
            await client.send(piece)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert await client.status() == 413
    assert peak < 10 * MIB
    assert running.app.n_asked == 0


@pytest.mark.parametrize(
    ("sent", "status", "after_s"),
    [
        (b"10000\r\n" + b"a" * 65536 + b"\r\n1\r\na\r\n", 413, 4.1),
        (b"1;a=" + b"b" * 300_000, 400, 0.0),
    ],
)
async def test_chunks_without_end_are_cut_off(
    running, sent: bytes, status: int, after_s: float
) -> None:
    client = await running.ask("/", "POST", "Transfer-Encoding: chunked\r\n")
    await client.send(sent)
    assert await client.status() == status
    running.pass_time(after_s)
    assert await client.is_closed()
