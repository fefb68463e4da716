"""Imported by the fork server alone, where it ties that process to the supervisor's life."""

from uavexp.sweep.child import die_with_parent

die_with_parent()
