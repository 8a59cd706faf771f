"""An example of a group: a machine whose recordings the virtual machine makes, cut by cut, while others' queries come in between."""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import tomllib
from contextlib import suppress

from api.files import Full, TooLarge
from api.reading.campaign_text import declare
from api.reading.uploads import Uploads, received
from api.stores.campaigns import Campaign
from api.stores.entities import Taken, Unavailable, digest_of
from api.work import examples
from api.work.pool import Busy, Work
from rcsa_ident.base.errors import InputError

log = logging.getLogger("rcsa_ident.reading")
MACHINE = "Example machine"
ABOUT = "An example: the virtual machine made its recordings. Forget it whenever you like."
#: What the recordings of the example take on the disk, as uploads and as samples, rounded up [bytes].
LARGEST = 15_000_000
#: Cuts under way at once: one is made while another one is read.
_LANES = 2
#: Pause before a cut is tried again where all workers are busy [s].
_PAUSE = 1.0


def example_id(group: str) -> str:
    """Return the id of a group's example machine and of its campaign, which tells that they are examples."""
    return f"example{hashlib.sha256(group.encode()).hexdigest()[:17]}"


def example_tooling(name: str) -> str:
    """Return the name of an example's tooling in the library."""
    return f"Example {name}"


class Examples:
    """Example campaigns in the making. `work`: where the virtual machine cuts."""

    def __init__(self, uploads: Uploads, work: Work) -> None:
        self.uploads, self.work = uploads, work
        self.making: dict[str, asyncio.Task[None]] = {}

    async def declared(self, group: str, created: str) -> tuple[Campaign, dict[str, str]]:
        """Return the campaign of the example, not stored yet, and the texts of its toolings by name, also of those that never cut."""
        text, toolings = await self.work.run(examples.plan)

        def declare_it() -> Campaign:
            name, declared, cuts = declare(tomllib.loads(text), toolings.get)
            return Campaign(example_id(group), group, example_id(group), f"Example: {name}", declared, cuts, created)

        return await asyncio.to_thread(declare_it), toolings

    async def untouched(self, group: str) -> dict[str, str]:
        """Return the example's toolings in the library that nobody has changed, with their digests: they go with it."""
        _, texts = await self.work.run(examples.plan)
        written = {example_tooling(name): digest_of(text) for name, text in texts.items()}

        def look() -> dict[str, str]:
            kept = {name: self.uploads.store.toolings.get(group, name) for name in written}
            return {name: document.digest for name, document in kept.items() if document is not None and document.digest == written[name]}

        return await asyncio.to_thread(look)

    def fill(self, campaign: Campaign) -> None:
        """Make what is missing of the campaign's recordings, unless that is under way."""
        running = self.making.get(campaign.group)
        if running is None or running.done():
            self.making[campaign.group] = asyncio.create_task(self._fill(campaign))

    async def _fill(self, campaign: Campaign) -> None:
        listed = await asyncio.to_thread(self.uploads.store.recordings.list, campaign.group, campaign.id, "", 1_000_000)
        there = {row.name for row in listed}
        lanes = asyncio.Semaphore(_LANES)

        async def make(number: int, cut: str, air: str) -> None:
            async with lanes:
                await self._cut(campaign, number, cut, air)

        cuts = [(k, cut["cut"], cut["air"]) for k, cut in enumerate(json.loads(campaign.text)["cuts"])]
        try:
            async with asyncio.TaskGroup() as group:
                for number, cut, air in cuts:
                    if not {cut, air} <= there:
                        group.create_task(make(number, cut, air))
        except* (KeyError, TooLarge, Full, Taken, InputError, Unavailable, OSError) as errors:
            # who deletes the campaign meanwhile wants no more of it
            told = {type(error).__name__ for error in errors.exceptions} - {"KeyError"}
            if told:
                log.warning("the example campaign is not complete", extra={"fields": {"error": ", ".join(sorted(told))}})

    async def _cut(self, campaign: Campaign, number: int, cut: str, air: str) -> None:
        """Make and store the recordings of a cut: first the one in the air, with which the other is judged."""
        paths = {name: self.uploads.files.spare(campaign.group) for name in (air, cut)}
        try:
            while True:
                with suppress(Busy):
                    await self.work.run(examples.make_cut, number, paths[cut], paths[air])
                    break
                await asyncio.sleep(_PAUSE)
            for name, path in paths.items():
                file = await asyncio.to_thread(received, path)
                await asyncio.to_thread(self.uploads.files.check_space, campaign.group, file.size)
                while True:
                    with suppress(Busy):
                        await self.uploads.take(campaign, name, file)
                        break
                    await asyncio.sleep(_PAUSE)
        finally:
            for path in paths.values():
                path.unlink(missing_ok=True)

    async def leave(self, group: str) -> None:
        """Stop making an example."""
        running = self.making.pop(group, None)
        if running is not None:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    async def stop(self) -> None:
        """Stop making all of them."""
        for group in list(self.making):
            await self.leave(group)
