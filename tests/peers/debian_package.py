"""Debian's own tools on our package: lintian, systemd-analyze and dpkg.

cargo-deb makes it for arm64, of the program that `cargo xtask build-pi` has built, and for amd64. The
first is installed into an empty root, and its service is started there by QEMU as its unit says: it
must tell systemd's socket that it is ready and alive, answer packets, and end when it is asked to.
Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import os
import re
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import time
from pathlib import Path

from peer import OUT, ROOT, edgepuck, run, skip

CARGO_DEB = "3.8.0"
TOOLS = ["cargo", "lintian", "dpkg", "deb-systemd-helper", "strip", "qemu-aarch64", "unshare"]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
PI = "aarch64-unknown-linux-musl"
# Root of one's own user namespace installs, and changes the root folder.
AS_ROOT = [] if os.geteuid() == 0 else ["unshare", "--map-root-user"]
# Of 0 to 10; systemd calls up to 2 "OK".
MOST_EXPOSED = 1.5
# An emulated processor takes some ten seconds for a turn.
START_S = 180.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


PORT = free_port()
# What an administrator would set.
OPTIONS = f"--udp {PORT} --interface 127.0.0.1"


def main():
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing or run(*AS_ROOT, "true", check=False).returncode != 0:
        skip(f"{', '.join(missing) or 'a user namespace'} is not to be had")
    if not (TARGET / PI / "pi/infer-cpu").is_file():
        skip("`cargo xtask build-pi` has not built the program for arm64")
    arm64, amd64 = packages()
    for package in (arm64, amd64):
        run("lintian", "--allow-root", "--fail-on", "error,warning", package)
        print(f"lintian: {package.name} is clean, {package.stat().st_size / 2**20:.1f} MiB")
    run("dpkg", "--extract", amd64, OUT / "amd64")
    run(OUT / "amd64/usr/bin/infer-cpu", "--version")
    root = install(arm64)
    check_unit(root)
    serve(root)
    dpkg(root, "--purge", "infer-cpu")
    left = [path for path in root.glob("**/*infer-cpu*") if "var/lib" not in str(path)]
    assert not left, f"purged, and still there: {left}"


def packages():
    """The packages that cargo-deb makes of what is built."""
    tools = OUT.parent.parent / "cargo-deb"
    cargo_deb = tools / "bin/cargo-deb"
    if not cargo_deb.exists() or CARGO_DEB not in run(cargo_deb, "--version").stdout:
        fetched = subprocess.run(
            ["cargo", "install", f"cargo-deb@{CARGO_DEB}", "--locked", "--debug",
             "--no-default-features", "--root", tools, "--target-dir", tools / "target"],
            check=False, env={**os.environ, "CARGO_PROFILE_DEV_DEBUG": "0"})
        if fetched.returncode != 0:
            skip("cargo-deb cannot be fetched")
        shutil.rmtree(tools / "target")
    program = OUT / "target/release/infer-cpu"
    program.parent.mkdir(parents=True)
    run("strip", "-o", program, os.environ["EDGEPUCK_INFER"])
    for folder, flags in ((TARGET, ["--target", PI, "--profile", "pi"]), (OUT / "target", [])):
        run(cargo_deb, "--no-build", *flags, "-o", f"{OUT}/", cwd=ROOT / "infer-cpu",
            env={**os.environ, "CARGO_TARGET_DIR": str(folder)})
    return [next(OUT.glob(f"*_{architecture}.deb")) for architecture in ("arm64", "amd64")]


def dpkg(root, *words):
    """dpkg on another root. Nothing that its scripts ask of systemd reaches that of this machine."""
    stubs = OUT / "stubs"
    stubs.mkdir(exist_ok=True)
    for name in ("systemctl", "deb-systemd-invoke"):
        (stubs / name).write_text("#!/bin/sh\n")
        (stubs / name).chmod(0o755)
    forced = ["architecture", "depends", "script-chrootless"]
    run(*AS_ROOT, "dpkg", f"--root={root}", f"--log={OUT}/dpkg.log",
        *(f"--force-{what}" for what in forced), *words,
        env={**os.environ, "PATH": f"{stubs}:{os.environ['PATH']}"})


def install(package):
    root = OUT / "root"
    for folder in ("info", "updates"):
        (root / "var/lib/dpkg" / folder).mkdir(parents=True)
    for file in ("status", "available"):
        (root / "var/lib/dpkg" / file).touch()
    dpkg(root, "--install", package)
    wanted = root / "etc/systemd/system/multi-user.target.wants/infer-cpu.service"
    assert wanted.is_symlink(), "the service starts with the system"
    # What an administrator has set stays when the package is installed again.
    (root / "etc/default/infer-cpu").write_text(f'INFER_CPU_LIVE="{OPTIONS}"\n')
    dpkg(root, "--install", package)
    assert OPTIONS in (root / "etc/default/infer-cpu").read_text()
    return root


def check_unit(root):
    """systemd understands the unit, and finds it hard to escape from."""
    if shutil.which("systemd-analyze") is None:
        print("systemd-analyze is not here: nothing has read the unit")
        return
    unit = OUT / "infer-cpu.service"
    text = (root / "usr/lib/systemd/system/infer-cpu.service").read_text()
    unit.write_text(text.replace("/usr/bin/infer-cpu", f"{root}/usr/bin/infer-cpu"))
    run("systemd-analyze", "verify", "--man=no", unit)
    told = run("systemd-analyze", "security", "--no-pager", "--offline=true", unit, check=False).stdout
    exposure = float(re.search(r"exposure level for .*: ([\d.]+)", told).group(1))
    print(f"systemd-analyze security: {exposure} of 10")
    assert exposure <= MOST_EXPOSED, told


def serve(root):
    """The service's life, as its unit starts it."""
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    (root / "run").mkdir(exist_ok=True)
    # A name from here: that of a socket has 107 bytes at most.
    manager.bind(os.path.relpath(root / "run/notify"))
    manager.settimeout(START_S)
    emulator = shutil.which("qemu-aarch64")
    libraries = re.findall(r"(/\S+) \(0x", run("ldd", emulator).stdout)
    for file in [emulator, *libraries]:
        inside = root / file.lstrip("/")
        inside.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, inside)
    unit = (root / "usr/lib/systemd/system/infer-cpu.service").read_text()
    command = shlex.split(re.search(r"^ExecStart=(.*)$", unit, re.MULTILINE).group(1))
    command.remove("$INFER_CPU_LIVE")
    settings = dict(line.split("=", 1) for line in
                    (root / "etc/default/infer-cpu").read_text().splitlines() if line[0] != "#")
    command += shlex.split(settings["INFER_CPU_LIVE"].strip('"'))
    lines = OUT / "objects.jsonl"
    service = subprocess.Popen(
        [*AS_ROOT, "chroot", str(root), emulator, "-cpu", "cortex-a76", *command],
        stdout=lines.open("w"),
        env={"PATH": os.environ["PATH"], "NOTIFY_SOCKET": "/run/notify",
             "WATCHDOG_USEC": "1000000"})
    try:
        assert manager.recv(999).decode().startswith("READY=1\n")
        assert manager.recv(999).decode().startswith("WATCHDOG=1\n"), "alive without a packet"
        sent = send()
        while f"{sent} packets" not in (told := manager.recv(999).decode()):
            assert told.startswith("WATCHDOG=1\n"), told
        service.send_signal(signal.SIGTERM)
        assert service.wait(START_S) == 0
    finally:
        service.kill()
    while (told := manager.recv(999).decode()) != "STOPPING=1\n":
        assert told.startswith("WATCHDOG=1\n"), told
    objects = [json.loads(line) for line in lines.read_text().splitlines()]
    n_named = sum(found["class"] is not None for found in objects)
    assert n_named > 50, f"{n_named} of {len(objects)} objects have a class"
    print(f"the service, on an emulated Cortex-A76: {sent} packets, {len(objects)} objects")


def send():
    """Sends the packets of half a second of a drive at their times; gives their number."""
    capture = OUT / "drive.pcap"
    edgepuck("gen-scenes", "--drive", "0.5", "--out", capture)
    content, at, n_packets = capture.read_bytes(), 24, 0
    start = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while at < len(content):
            _, time_us, n_bytes, _ = struct.unpack_from("<4I", content, at)
            time.sleep(max(0.0, start + time_us * 1e-6 - time.monotonic()))
            # The headers of Ethernet, IP and UDP are 42 bytes.
            sender.sendto(content[at + 16 + 42 : at + 16 + n_bytes], ("127.0.0.1", PORT))
            at, n_packets = at + 16 + n_bytes, n_packets + 1
    return n_packets


main()
