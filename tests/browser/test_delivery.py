"""Who cannot be told of alarms is seen on the alarm page, and goes when it can be again."""

import asyncio
import socket

from on_screen import DATA_MS
from playwright.async_api import expect

RECEIVER = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
max_retry_s = 1.0
"""


async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.readuntil(b"\r\n\r\n")
    writer.write(b"HTTP/1.1 204 No Content\r\n\r\n")
    writer.close()


async def test_a_receiver_that_is_away_is_named_until_it_has_taken_what_waits(
    new_plant, page, complaints_of
) -> None:
    complaints = complaints_of(page)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    new_plant.settings += RECEIVER.format(port=port)
    new_plant.start_service()  # without its DAQ: the link is lost
    await page.goto(f"{new_plant.url}#/alarms")

    line = page.locator(".delivery li")
    await expect(line).to_contain_text("desk: not delivered since", timeout=DATA_MS)
    await expect(line).to_contain_text("1 message waits since")
    await expect(line.locator(".mark")).to_have_attribute("data-look", "bad")

    async with await asyncio.start_server(take, "127.0.0.1", port):
        await expect(page.locator(".delivery")).to_be_hidden(timeout=DATA_MS)
    assert complaints == []
