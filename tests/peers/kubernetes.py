"""The job file for Kubernetes has the fields that its official client knows, of the right types.

There is no cluster here: `tests/cli/clusters.rs` runs what a pod runs. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import json

from peer import edgepuck, skipped_if_missing

with skipped_if_missing():
    import kubernetes
    import yaml
    from kubernetes.client import ApiClient, V1Job

words = "cluster kubernetes --parts 5 -- meshes --layout webdataset --sensor vlp32c --out out".split()
told = yaml.safe_load(edgepuck(*words).stdout)
client = ApiClient()
job = client.deserialize(json.dumps(told), "V1Job", "application/json")
assert isinstance(job, V1Job)
# What the client does not know it leaves out.
assert client.sanitize_for_serialization(job) == told
spec = job.spec
assert (spec.completion_mode, spec.completions, spec.parallelism) == ("Indexed", 5, 5)
(container,) = spec.template.spec.containers
assert spec.pod_failure_policy.rules[1].on_exit_codes.container_name == container.name
assert spec.template.spec.restart_policy == "Never"
print(f"kubernetes {kubernetes.__version__}: the job file is a V1Job")
