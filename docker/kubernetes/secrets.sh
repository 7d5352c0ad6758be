#!/bin/sh
# Print the Secrets of these manifests, with new passwords: sh docker/kubernetes/secrets.sh | kubectl apply -f -
set -eu
random() { od -An -N24 -tx1 /dev/urandom | tr -d ' \n'; }
token="wetwell_$(random)"
cat <<END
apiVersion: v1
kind: Secret
metadata: {name: bus, namespace: wetwell}
stringData:
END
users=
for name in gateway historian alarms watch dashboard branch fleet; do
  password=$(random)
  echo "  $name: $password"
  if [ "$name" = fleet ]; then
    printf '  branch_users: |\n    %s:%s\n' "$name" "$password"
  else
    users="$users    $name:$password
"
  fi
done
printf '  users: |\n%s' "$users"
cat <<END
---
apiVersion: v1
kind: Secret
metadata: {name: tokens, namespace: wetwell}
stringData:
  tokens: |
    [[token]]
    name = "operator"
    role = "operator"
    sha256 = "$(printf %s "$token" | sha256sum | cut -d ' ' -f 1)"
END
echo "token of the operator, shown this once: $token" >&2
