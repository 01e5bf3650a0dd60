"""(a) Iterations needed with and without the inertial seed; Figure 4: one with it against thirty without."""
from matplotlib.ticker import FixedLocator, NullLocator

import figures
from page import code, complete, figure, list_of, millimetres, percent, quantile, recordings, table, tracked
from runs import WAYS, flat

LETTER, TITLE = "a", "Iterations a frame, with the inertial seed and without (Section 3.1, Figure 4)"
BUDGETS = (1, 3, 10, 30)
MOST = BUDGETS[-1]
GOOD = 1.25  # a result is as good as another when its error is at most this many times the other's
FINE = 0.005   # metres; or when it is below this anyway
WRONG = 0.01   # metres; a result has gone wrong when its error is twice the other's and above this, or frames weren't tracked


def scenes(runs):
    """name, recording, options of the replay; the detailed ones first, the bare one last."""
    kitchen = runs.given("kitchen")
    if kitchen:
        yield "kitchen, every 4th frame", kitchen, ["--stride", "4"]
        yield "kitchen, every 8th frame", kitchen, ["--stride", "8"]
    room, wall = ([], []) if runs.tiny else (["--frames", "150"], ["--frames", "120"])
    yield "room", runs.simulate("room-brisk", "room", "--speed", "2", *room), []
    yield "bare wall", runs.simulate("wall-brisk", "wall", "--speed", "2", *wall), []


def measure(runs):
    chosen = list(scenes(runs))
    jobs = []
    for scene, recording, options in chosen:
        for way, how in WAYS.items():
            for budget in BUDGETS:
                keep = ["iterations", "state"] if budget == MOST else []
                options_all = [*options, *how, "--iterations", f"0,0,{budget}"]
                jobs.append(((scene, way, budget), lambda r=recording, o=options_all, k=keep: runs.replay(r, o, k)))
    return {"scenes": [scene for scene, _, _ in chosen], "made": [r.made_by for _, r, _ in chosen],
            "runs": flat(runs.all(jobs))}


def needed(run):
    """Iterations that the tracked frames spent until the stop rule."""
    return [n for n, state in zip(run["series"]["iterations"], run["series"]["state"]) if state == "tracked"]


def by_name(results):
    return {tuple(run["name"]): run for run in results["runs"]}


def draw_needed(results, folder):
    runs = by_name(results)
    plot, axes = figures.panels(len(results["scenes"]), 3.2, 10.5, sharey=True)
    for axis, scene in zip(axes, results["scenes"]):
        for way in WAYS:
            values = needed(runs[scene, way, MOST])
            if values:
                shares = [100 * sum(v <= n for v in values) / len(values) for n in range(0, MOST + 1)]
                axis.step(range(0, MOST + 1), shares, where="post", label=way, **figures.line_style(way))
        axis.set(title=scene, xlabel="iterations until the stop rule", xlim=(0, MOST), ylim=(0, 101))
    axes[0].set_ylabel("tracked frames that needed\nat most so many, %")
    figures.legend_below(plot, axes[-1])
    plot.suptitle("Iterations needed a frame, finest level only, cumulative")
    figures.save(plot, folder, "iterations-needed")


def draw_budget(results, folder):
    runs = by_name(results)
    plot, axes = figures.panels(len(results["scenes"]), 3.4, 10.5, sharey=True)
    for axis, scene in zip(axes, results["scenes"]):
        for way in WAYS:
            style = figures.line_style(way, markers=True)
            line = [runs[scene, way, budget] for budget in BUDGETS]
            axis.plot(BUDGETS, [1000 * run["ate_rmse_m"] for run in line], label=way, **style)
            failed = [(b, 1000 * run["ate_rmse_m"]) for b, run in zip(BUDGETS, line) if not complete(run)]
            if failed:
                axis.plot(*zip(*failed), linestyle="none", marker=style["marker"], markerfacecolor="white",
                          markeredgecolor=style["color"], zorder=5)
        axis.set(title=scene, xlabel="iterations allowed a frame", xscale="log", yscale="log")
        axis.xaxis.set_major_locator(FixedLocator(BUDGETS))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.set_xticklabels([str(b) for b in BUDGETS])
    axes[0].set_ylabel("trajectory error (ATE), mm")
    figures.legend_below(plot, axes[0])
    plot.suptitle("Error by iterations allowed a frame; hollow: some frames were not tracked")
    figures.save(plot, folder, "iterations-allowed")


def as_good(one, other):
    """All frames tracked, and an error no worse than the other's, or a fine one."""
    return complete(one) and one["ate_rmse_m"] <= max(GOOD * other["ate_rmse_m"], FINE)


def claims(results):
    runs = by_name(results)
    rows = []
    for kind in ("paper", "fathom"):
        detailed = [s for s in results["scenes"] if s != "bare wall"]
        good = [s for s in detailed if as_good(runs[s, f"{kind}, IMU", 1], runs[s, f"{kind}, no IMU", MOST])]
        rows.append((f"On scenes with much detail one iteration with the seed suffices (Figure 4, top); {kind}'s way",
                     f"{'holds' if good == detailed else 'holds in part' if good else 'does not hold'}: as good as {MOST} "
                     f"without on " + (list_of(good) if good else "none") + f" (of {len(detailed)} cases)"))
        with_seed, without = runs["bare wall", f"{kind}, IMU", 1], runs["bare wall", f"{kind}, no IMU", MOST]
        wrong = not complete(without) or without["ate_rmse_m"] >= max(2 * with_seed["ate_rmse_m"], WRONG)
        rows.append((f"On a bare scene {MOST} iterations without the IMU go wrong where 1 with it does not (Figure 4, bottom); "
                     f"{kind}'s way", f"{'holds' if wrong and complete(with_seed) else 'does not hold'}: ATE "
                     f"{millimetres(with_seed['ate_rmse_m'])} with 1 and the IMU, "
                     f"{millimetres(without['ate_rmse_m'])} ({tracked(without)} tracked) with {MOST} and without"))
    return rows


def page(results, folder):
    draw_needed(results, folder)
    draw_budget(results, folder)
    runs = by_name(results)
    lines = [f"Alignment at the finest level only (`--iterations 0,0,N`). *Needed* is what a frame spends until the stop rule "
             f"(an update below 0.1 mrad and 0.1 mm, or an error that no longer falls) when {MOST} are allowed; the last one only "
             f"confirms. Tracked frames only. The detailed scenes are a real kitchen and a furnished room passed at twice the "
             f"usual pace; the bare one is a wall that fills the view for a while.", ""]
    lines += recordings(results["made"])
    rows = []
    for scene in results["scenes"]:
        for way in WAYS:
            run = runs[scene, way, MOST]
            values = needed(run) or [float("nan")]
            rows.append((scene, way, f"{quantile(values, 0.5):.0f}", f"{quantile(values, 0.9):.0f}", f"{max(values):.0f}",
                         percent(sum(v <= 3 for v in values) / len(values)), tracked(run), code(run["command"])))
    lines += table(("scene", "way", "needed, median", "90 %", "most", "3 or fewer", "tracked", "command"), rows)
    lines += figure("iterations-needed", "How many frames needed how many iterations")
    lines += [f"Figure 4's claim, ATE over all frames and frames tracked, with 1 iteration and with {MOST}:", ""]
    rows = []
    for scene in results["scenes"]:
        for way in WAYS:
            for budget in (1, MOST):
                run = runs[scene, way, budget]
                rows.append((scene, way, budget, millimetres(run["ate_rmse_m"]), tracked(run), code(run["command"])))
    lines += table(("scene", "way", "iterations", "ATE", "tracked", "command"), rows)
    lines += figure("iterations-allowed", "Trajectory error by the iterations allowed")
    lines += ["The other points of this figure come from the same commands with " +
              list_of(f"`0,0,{b}`" for b in BUDGETS[1:-1]) + ".", ""]
    return lines
