#!/bin/sh
# Make the secrets of docker/compose.yaml, those that are not there yet: a password a daemon, and the operator's token.
set -eu
cd "$(dirname "$0")"
mkdir -p secrets site
chmod 700 secrets  # the files are read by the containers' user, who is nobody on this machine
random() { od -An -N24 -tx1 /dev/urandom | tr -d ' \n'; }
for name in bus_simulator bus_gateway bus_detector bus_historian bus_alarms bus_watch bus_dashboard postgres_password grafana_password; do
  [ -s "secrets/$name" ] || random > "secrets/$name"
done
rm -f secrets/bus_users
for name in simulator gateway detector historian alarms watch dashboard; do
  printf '%s:%s\n' "$name" "$(cat "secrets/bus_$name")"
done > secrets/bus_users
if [ ! -s secrets/tokens ]; then
  token="wetwell_$(random)"
  hash=$(printf %s "$token" | sha256sum | cut -d ' ' -f 1)
  printf '[[token]]\nname = "operator"\nrole = "operator"\nsha256 = "%s"\n' "$hash" > secrets/tokens
  echo "token of the operator, shown this once: $token"
fi
chmod 444 secrets/*
