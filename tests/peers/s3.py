"""Tars go to an object store as they are completed, and none is lost when the run is killed midway.

moto is the S3 server; boto3, which comes with it, uploads. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import logging
import os
import shlex
import signal
import subprocess
import sys
import time

from peer import EDGEPUCK, OUT, edgepuck, save_shapes, skipped_if_missing, tars

with skipped_if_missing():
    import boto3
    import moto
    from moto.server import ThreadedMotoServer

BUCKET = "lidar"
UPLOAD = """
import boto3, sys, time
time.sleep(0.2)  # as a network does
boto3.client("s3", endpoint_url=sys.argv[1]).upload_file(sys.argv[2], "lidar", sys.argv[3])
"""

# It would tell each request.
logging.getLogger("werkzeug").setLevel(logging.ERROR)
os.environ |= {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}
server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
server.start()
host, port = server.get_host_and_port()
endpoint = f"http://{host}:{port}"
store = boto3.client("s3", endpoint_url=endpoint)
store.create_bucket(Bucket=BUCKET)
(OUT / "upload.py").write_text(UPLOAD)


def stored():
    found = store.list_objects_v2(Bucket=BUCKET).get("Contents", [])
    return {of["Key"]: store.get_object(Bucket=BUCKET, Key=of["Key"])["Body"].read() for of in found}


upload = shlex.join([sys.executable, str(OUT / "upload.py"), endpoint])
words = ["gen-dataset", OUT / "shapes", "--layout", "webdataset", "--sensor", "vlp32c", "--views", "6",
         "--points", "256", "--adapter", "cpu", "--tar-clouds", "60", "--out", OUT / "out", "--resume",
         "--on-shard", upload + " {} {name}"]
save_shapes(4, 1)
run = subprocess.Popen([EDGEPUCK, *words], stderr=subprocess.DEVNULL, start_new_session=True)
while not stored() and run.poll() is None:
    time.sleep(0.02)
# The upload of the next tar is killed with it.
os.killpg(run.pid, signal.SIGKILL)
assert run.wait() != 0, "the run ended before it was killed"
before = stored()
edgepuck(*words)
written = tars("out")
assert 0 < len(before) < len(written)
assert stored() == written
server.stop()
print(f"moto {moto.__version__}: {len(written)} tars, {len(before)} of them before the run was killed")
