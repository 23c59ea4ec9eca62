"""Layouts of messages: protobuf, JSON and ROS 2 CDR read into numbers, and the few messages that pmg writes."""
