"""Imported by the fork server alone, where it ties that process to the supervisor's life."""

import signal

from uavexp.sweep.child import die_with_parent

signal.signal(signal.SIGINT, signal.SIG_IGN)  # also while it imports: the supervisor handles Ctrl-C
die_with_parent()
