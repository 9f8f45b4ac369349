"""A bundle as one ZIP file, made while it is sent, so that it takes neither memory nor disk."""

from collections.abc import Mapping
from pathlib import Path

from service.reports.archive import EvidenceArchive, Occurrence, capture_folder
from service.reports.capture_link import linked

README = """Evidence of an alarm, made by padwatch.

report.html             one page to read or print
evidence.json           all of it; its keys are described in docs/how-to/evidence.md of padwatch
spectra.parquet         cross-spectra of all bearings of the unit
orbits.parquet          the newest turns of the shaft
trend.parquet           readings of the film before the alarm
configuration.json      settings of the plant, without secrets; not for a key of some units
capture.json            which recording holds the samples around the alarm
samples/                that recording: padwatch recording info|verify|export reads it
"""


def bundle_files(
    archive: EvidenceArchive, found: Occurrence, page: str, has_configuration: bool
) -> Mapping[str, Path | bytes]:
    """The files of a bundle by their names in it.

    Parameters
    ----------
    has_configuration
        Whether the settings of the whole plant are among them.

    Raises
    ------
    DamagedEvidenceError, LookupError
        If it cannot be read, or is not there.
    """
    if found.place is None:
        raise LookupError("there is no bundle")
    files: dict[str, Path | bytes] = {"README.txt": README.encode(), "report.html": page.encode()}
    files |= {path.name: path for path in sorted(found.place.folder.iterdir())}
    if has_configuration:
        configuration = archive.configuration(archive.document(found.place).configuration)
        if configuration is not None:
            files["configuration.json"] = configuration
    capture = linked(found.place.folder)
    samples = None if capture is None else capture_folder(found.place, capture)
    if samples is not None:
        files |= {f"samples/{path.name}": path for path in sorted(samples.iterdir())}
    return files
