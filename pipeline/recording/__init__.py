"""Recordings of layout pmg.v1: the container, its messages, and what they mean."""

from pmg.pipeline.recording.findings import Code, Finding, Severity, UnusableRecordingError
from pmg.pipeline.recording.read import Recording, read_recording

__all__ = ["Code", "Finding", "Recording", "Severity", "UnusableRecordingError", "read_recording"]
