"""Hosts on one machine, and a link between them that behaves as a real network does."""

from deploy.sim.network.host import EmulatedHost as EmulatedHost
from deploy.sim.network.network import Network as Network
from deploy.sim.network.network import open_network as open_network
from deploy.sim.network.profile import Profile as Profile
from deploy.sim.network.profile import Way as Way
from deploy.sim.network.profile import load_profile as load_profile
from deploy.sim.network.profile import profile_names as profile_names
