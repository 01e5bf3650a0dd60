"""What the bench runs on, for the head of its table."""
import os
import platform
import subprocess


def cpu_model():
    """As the kernel names it; ARM kernels give only numbers, so the board's name is tried too."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.split(":")[0].strip() == "model name":
                    return line.split(":", 1)[1].strip()
        with open("/proc/device-tree/model", encoding="utf-8") as file:
            return file.read().strip("\0\n ")
    except OSError:
        return platform.processor() or platform.machine()


def opencl(build):
    """The platform and device that fathom plans for, from `fathom info`."""
    run = subprocess.run([os.path.join(build, "fathom"), "info", "--plan"], capture_output=True, text=True, check=False)
    def after(key):
        return [line.split(":", 1)[1].strip() for line in run.stdout.splitlines() if line.startswith(key + ":")]
    platforms, plans = after("OpenCL platform"), after("plan")
    return {"platforms": platforms, "device": plans[0] if plans else "none"}


def describe(build):
    return {"cpu": cpu_model(), "cores": len(os.sched_getaffinity(0)),
            "memory_gb": round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2 ** 30, 1),
            "system": f"{platform.system()} {platform.release()}", "load_at_start": round(os.getloadavg()[0], 2),
            "opencl": opencl(build)}


def lines(machine):
    platforms = machine["opencl"]["platforms"]
    text = [f"machine: {machine['cpu']}, {machine['cores']} cores, {machine['memory_gb']} GB, {machine['system']}",
            f"OpenCL: {platforms[0] if platforms else 'none'}; device {machine['opencl']['device']}"]
    if machine["load_at_start"] > 0.5:
        text.append(f"load at start: {machine['load_at_start']}: something else was running, so times are "
                    "noisy, and ratios too")
    return text
