"""Vehicle files for tests."""

from dataclasses import fields

from ehar.flight.vehicle import VehicleFile

FILE_KEYS = tuple(field.name for field in fields(VehicleFile) if field.name != "body")  # of every file
