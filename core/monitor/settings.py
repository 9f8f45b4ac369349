"""How the analysis is set up; the defaults are the paper's (Brito et al., section 3.1)."""

from dataclasses import dataclass, field

from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.evidence import EvidenceSettings


@dataclass(frozen=True)
class AnalysisSettings(EvidenceSettings):
    """Segments, averaging, what counts as evidence, and how all eight coefficients are sought."""

    dynamic: DynamicSettings = field(default_factory=DynamicSettings)
