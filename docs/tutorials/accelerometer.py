#!/usr/bin/python3
"""Publishes an accelerometer as /smartmill/daq/vibration: a driver to start from. read() returns your samples in place of a computed cut."""
import math
import random

import rospy
from smartmill_msgs.msg import SampleBlock

RATE = 10000.0  # [Hz]
BLOCK = 100  # samples, 10 ms
TOOTH_PASSING = 2.0 * math.pi * 4 * 8000.0 / 60.0  # [rad/s] of the computed cut: four teeth, 8000 rpm
CHATTER = 2.0 * math.pi * 1100.0  # [rad/s]


def acceleration(time):
    """[m/s2] Harmonics of the tooth passing frequency, and chatter that the teeth modulate."""
    harmonics = sum(8.0 / m * math.sin(m * TOOTH_PASSING * time + m) for m in range(1, 9))
    return harmonics + 5.0 * math.sin(CHATTER * time) * (1.0 + 0.5 * math.sin(TOOTH_PASSING * time)) + random.gauss(0.0, 0.2)


def read(first):
    """The next BLOCK samples [m/s2], beginning with sample `first` since the start."""
    return [acceleration((first + k) / RATE) for k in range(BLOCK)]


def main():
    rospy.init_node("accelerometer")
    publisher = rospy.Publisher("/smartmill/daq/vibration", SampleBlock, queue_size=100)
    start, first = rospy.Time.now(), 0
    while not rospy.is_shutdown():
        block = SampleBlock(sample_rate=RATE, first_index=first, channels=["acceleration"], units=["m/s2"], samples=read(first))
        # Of the first sample, by the clock of the samples: no jitter of the operating system.
        block.header.stamp = start + rospy.Duration.from_sec(first / RATE)
        first += BLOCK
        rospy.sleep(start + rospy.Duration.from_sec(first / RATE) - rospy.Time.now())  # until the block is complete
        publisher.publish(block)


if __name__ == "__main__":
    try:
        main()
    except rospy.ROSInterruptException:
        pass
