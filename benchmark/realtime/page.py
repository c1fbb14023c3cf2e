#!/usr/bin/python3
"""A browser as the panel sees it: shows what the page shows at first, asks for frame after frame.

usage: page.py URL COLUMN,...
"""

import asyncio
import json
import sys

from tornado.websocket import websocket_connect


async def look(url, columns):
    socket = await websocket_connect(url.replace("http", "ws", 1) + "socket",
                                     max_message_size=1 << 28)
    view = {"columns": columns, "latest": ["inputs/drive_torque"], "seconds": 30}
    await socket.write_message(json.dumps({"show": view, "pull": 1}))
    frames = 0
    while True:
        message = await socket.read_message()
        if isinstance(message, bytes):
            frames += 1
            if frames == 100:
                print("looking", flush=True)
            await socket.write_message('{"pull": 1}')
        elif message is None:
            return


if __name__ == "__main__":
    asyncio.run(look(sys.argv[1], sys.argv[2].split(",")))
