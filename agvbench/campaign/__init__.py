"""Campaign directories: read, check, append, import."""

from agvbench.campaign.campaign import Campaign
from agvbench.campaign.header import CampaignHeader
from agvbench.campaign.recordings.importer import import_recordings
from agvbench.campaign.writer import CampaignWriter

__all__ = ["Campaign", "CampaignHeader", "CampaignWriter", "import_recordings"]
