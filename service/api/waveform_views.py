"""The newest samples of a unit in the words of the API."""

from collections.abc import Sequence

from service.api.channel_models import ChannelSamplesModel, WaveformModel
from service.api.channel_views import UNITS
from service.api.film_series_views import listed
from service.api.views import quality_model
from service.live.samples import Stretch
from service.runtime.times import rfc3339
from service.settings.units import UnitSettings


def waveform_model(
    settings: UnitSettings, channels: Sequence[str], stretch: Stretch, age_s: float
) -> WaveformModel:
    """A stretch in the words of the API."""
    units = {each.id: UNITS[each.measurand] for each in settings.channel}
    found = zip(channels, stretch.samples, stretch.quality, strict=True)
    return WaveformModel(
        unit=settings.id,
        time=rfc3339(stretch.start_ns),
        age_s=age_s,
        epoch=stretch.epoch,
        first_index=stretch.first_index,
        rate_hz=stretch.rate_hz,
        n_samples=stretch.samples.shape[1],
        channels={
            id_: ChannelSamplesModel(
                unit=units[id_],
                quality=quality_model(quality),
                sample=listed(row),
            )
            for id_, row, quality in found
        },
    )
