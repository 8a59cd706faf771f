"""Server-sent events as the page reads them: the same events wherever a connection cuts the stream into parts."""

from __future__ import annotations

import pytest

#: Follow a stream that comes in two parts, cut at every place in turn; for each the events with their data.
FOLLOW = """async (text) => {
  const base = document.querySelector('script[type=module]').src.replace(/main\\.js$/, '');
  const { follow } = await import(base + 'api.js');
  const bytes = new TextEncoder().encode(text), real = window.fetch, all = [];
  for (let cut = 1; cut < bytes.length; cut++) {
    const found = [];
    let parts = [bytes.slice(0, cut), bytes.slice(cut)];
    window.fetch = (address, more) => {
      if (!`${address}`.endsWith('jobs/x/events')) return real(address, more);
      const now = parts;
      // who comes again has missed the end
      parts = [new TextEncoder().encode('event: end\\ndata: 0\\n\\n')];
      return Promise.resolve(new Response(new ReadableStream({ start(to) { now.forEach((each) => to.enqueue(each)); to.close(); } })));
    };
    try { await follow('jobs/x/events', (name, data) => { found.push([name, data]); return name === 'end'; }); }
    finally { window.fetch = real; }
    all.push(found);
  }
  return all;
}"""
TEXT = 'retry: 2000\nevent: progress\ndata: "ä"\n\nid: 7\nevent: note\ndata: [1,\ndata: 2]\n\n: ping\n\nevent: end\ndata: 3\n\n: over\n\n'


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_wherever_the_stream_is_cut_its_events_are_the_same(opened, end):
    found = opened().evaluate(FOLLOW, TEXT.replace("\n", end))
    assert len(found) == len(TEXT.replace("\n", end).encode()) - 1
    assert all(each == [["progress", "ä"], ["note", [1, 2]], ["end", 3]] for each in found)
