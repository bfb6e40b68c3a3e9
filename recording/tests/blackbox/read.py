"""Reads black boxes with the public `mcap` package; a job per line, as JSON."""

import json
import sys

from mcap.reader import SeekingReader, make_reader


def read(path):
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        if not isinstance(reader, SeekingReader):
            raise TypeError("expected a reader that seeks")
        summary = reader.get_summary()
        topics = {number: channel.topic for number, channel in summary.channels.items()}
        counts = summary.statistics.channel_message_counts
        seen, times = {}, []
        for _, channel, message in reader.iter_messages():
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
            times.append(message.log_time)
        middle = times[len(times) // 2] if times else 0
        late = sum(1 for _ in reader.iter_messages(start_time=middle))
        alone = sum(1 for _ in reader.iter_messages(topics=["/trued/cycle"], reverse=True))
        chunks = summary.chunk_indexes
        return {
            "counts": {topics[number]: count for number, count in counts.items()},
            "seen": seen,
            "in_order": times == sorted(times),
            "first_ns": times[0] if times else 0,
            "last_ns": times[-1] if times else 0,
            "late": late,
            "late_expected": sum(1 for time in times if time >= middle),
            "cycles_alone": alone,
            "chunks": len(chunks),
            "profile": reader.get_header().profile,
            "metadata": [[m.name, m.metadata] for m in reader.iter_metadata()],
            "attachments": [[a.name, a.data.decode()] for a in reader.iter_attachments()],
        }


for line in sys.stdin:
    print(json.dumps(read(json.loads(line)["file"])))
