"""Prints what a Sparkplug B historian sees of one group: `historian.py HOST PORT GROUP`, one JSON line for each message.

Uses the public packages `mqtt-spb-wrapper` (its decoder of the payload) and `paho-mqtt`. A line `rebirth NODE` on standard input asks a node to be born again.
"""

import json
import sys
import threading

import paho.mqtt.client as mqtt
from mqtt_spb_wrapper.spb_protobuf import addMetric
from mqtt_spb_wrapper.spb_protobuf.sparkplug_b import MetricDataType
from mqtt_spb_wrapper.spb_protobuf.sparkplug_b_pb2 import Payload

host, port, group = sys.argv[1], int(sys.argv[2]), sys.argv[3]


def on_connect(client, _userdata, _flags, _code):
    client.subscribe(f"spBv1.0/{group}/#", qos=1)


def on_subscribe(_client, _userdata, _mid, _qos):
    print(json.dumps({"subscribed": True}), flush=True)


def on_message(_client, _userdata, message):
    kind = message.topic.split("/")[2]
    payload = Payload()
    payload.ParseFromString(message.payload)
    metrics = {}
    for metric in payload.metrics:
        field = metric.WhichOneof("value")
        metrics[metric.name] = None if metric.is_null or field is None else getattr(metric, field)
    seen = {
        "topic": message.topic,
        "kind": kind,
        "seq": payload.seq if payload.HasField("seq") else None,
        "timestamp": payload.timestamp,
        "made": max((metric.timestamp for metric in payload.metrics), default=0),
        "historical": any(metric.is_historical for metric in payload.metrics),
        "types": {metric.name: metric.datatype for metric in payload.metrics},
        "metrics": metrics,
    }
    print(json.dumps(seen), flush=True)


def commands(client):
    for line in sys.stdin:
        command = Payload()
        addMetric(command, "Node Control/Rebirth", None, MetricDataType.Boolean, True)
        client.publish(f"spBv1.0/{group}/NCMD/{line.split()[1]}", bytearray(command.SerializeToString()))


client = mqtt.Client("historian")
client.on_connect, client.on_subscribe, client.on_message = on_connect, on_subscribe, on_message
client.reconnect_delay_set(1, 1)
client.connect(host, port, 60)
threading.Thread(target=commands, args=(client,), daemon=True).start()
client.loop_forever()
