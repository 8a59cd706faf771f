"""From recordings of ordinary cuts to a speed and a depth for a tool that never cut, and the forces of one of the cuts.

The virtual machine makes the recordings on the spot, in half a minute; a campaign of your own is a folder for `read_campaign`.
"""

import rcsa_ident as ri

campaign = ri.sample_campaign("sample_runs")
found = ri.identify(campaign, seed=1)
print(found)
found.save("RESULT.json")

tool = ri.sample_tooling("S3-PG25-long")
advice = ri.advise(found, tool, ri.CutSpec(feed_per_tooth=0.1e-3), drive=ri.SpindleDrive.flat(power=10e3))
print(advice)
advice.save("advice.svg")

cut = campaign.cuts[5]
forces = ri.estimate_forces(found, campaign.toolings[cut.tooling], cut)
print(forces)
forces.save("FORCES.csv")
