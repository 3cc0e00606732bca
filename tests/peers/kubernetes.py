"""The job file for Kubernetes has the fields that its official client knows, of the right types.

There is no cluster here: this script runs what a pod runs. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import json

from peer import OUT, edgepuck, job_file, program_on_path, run, save_shapes, skipped_if_missing

with skipped_if_missing():
    import kubernetes
    import yaml
    from kubernetes.client import ApiClient, V1Job

PARTS = 3
WORDS = ["meshes", "--layout", "webdataset", "--sensor", "vlp32c", "--points", "64", "--views", "2",
         "--adapter", "cpu", "--tar-clouds", "20", "--out", "lidar"]

told = yaml.safe_load(job_file("job.yaml", PARTS, WORDS))
client = ApiClient()
job = client.deserialize(json.dumps(told), "V1Job", "application/json")
assert isinstance(job, V1Job)
# What the client does not know it leaves out.
assert client.sanitize_for_serialization(job) == told
spec = job.spec
assert (spec.completion_mode, spec.completions, spec.parallelism) == ("Indexed", PARTS, PARTS)
(container,) = spec.template.spec.containers
assert spec.pod_failure_policy.rules[1].on_exit_codes.container_name == container.name
assert spec.template.spec.restart_policy == "Never"

save_shapes(2, 1, "meshes")
env = program_on_path()
(OUT / "task.sh").write_text(job_file("task.sh", PARTS, WORDS))
for index in range(PARTS):
    run(*container.command, cwd=OUT, env=env | {"JOB_COMPLETION_INDEX": str(index)})
edgepuck("gen-dataset", "--verify", OUT / "lidar")
assert f"of-{PARTS:04}" in (OUT / "lidar/dataset.json").read_text()
print(f"kubernetes {kubernetes.__version__}: the job file is a V1Job, and its pods make the whole data set")
