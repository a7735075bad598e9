"""A study that nobody computed: plausible in form, plainly invented in its numbers."""

import random
from typing import Any

from gestured.simulator import GESTURES

Study = dict[str, Any]
METHODS = {
    "st_knn": ("spatio-temporal features, k nearest neighbours", "spatio-temporal features", (0.62, 0.79)),
    "st_rf": ("spatio-temporal features, random forest", "spatio-temporal features", (0.58, 0.96)),
    "st_svm": ("spatio-temporal features, support vector machine (RBF)", "spatio-temporal features", (0.58, 0.98)),
    "tp_knn": ("touch-pattern features, k nearest neighbours", "touch-pattern features", (0.56, 0.98)),
    "tp_rf": ("touch-pattern features, random forest", "touch-pattern features", (0.60, 0.98)),
    "tp_svm": ("touch-pattern features, support vector machine (RBF)", "touch-pattern features", (0.56, 0.97)),
    "cnn": ("CNN on motion history images", "motion history image", (0.77, 0.81)),
    "lstm": ("LSTM", "recurrent", (0.82, 0.97)),
    "cnn_lstm": ("CNN-LSTM", "recurrent", (0.89, 0.97)),
    "cnn_gru": ("CNN-GRU", "beyond the paper", None),
    "tcn": ("causal TCN", "beyond the paper", None),
    "transformer": ("small transformer", "beyond the paper", None),
    "trajectory": ("trajectory features, gradient boosting", "beyond the paper", None),
}
SHORT = {  # how a reader may expect them in a figure
    "st_knn": "spatio-temporal KNN",
    "st_rf": "spatio-temporal random forest",
    "st_svm": "spatio-temporal SVM",
    "tp_knn": "touch-pattern KNN",
    "tp_rf": "touch-pattern random forest",
    "tp_svm": "touch-pattern SVM",
    "trajectory": "trajectory gradient boosting",
}
NAMES = {method: SHORT.get(method, title) for method, (title, _, _) in METHODS.items()}


def made_study(seed: int = 5) -> Study:
    """Every part of the schema, filled."""
    chance = random.Random(seed)
    about = {
        "version": "0.0-made-up",
        "command": "gestured-lab study --out report/",
        "seed": 0,
        "seeds": 3,
        "quick": False,
        "models": {"lstm": "ab" * 32},
        "paper": "somebody, made up",
    }
    study: Study = {
        "about": {**about, "gestures": list(GESTURES)},
        "machine": _machine(),
        "data": _data(),
        "methods": _methods(),
        "cells": [cell for method in METHODS for cell in _cells(method, chance)],
        "copies": [_copies(method, chance) for method in METHODS],
        "tuning": [_tuning(method, chance) for method in ("st_knn", "st_svm", "tp_svm", "lstm")],
        "choices": _choices(chance),
        "run_time": [row for method in METHODS for row in _run_time(method, chance)],
        "calibration": [_calibration(method, chance) for method in ("tp_rf", "lstm", "cnn_lstm", "tcn")],
        "online": [_online(method, chance) for method in ("tp_rf", "lstm", "cnn_lstm")],
        "said": _said(),
        "online_shipped": [_online(method, chance) for method in ("lstm", "cnn_lstm")],
    }
    for row in study["run_time"]:
        beaten = (r["median_us"] < row["median_us"] and r["right"] >= row["right"] for r in study["run_time"])
        row["front"] = not any(beaten)
    return study


def _machine() -> Study:
    versions = {"python": "3.11.2", "numpy": "2.4", "torch": "2.13", "sklearn": "1.9", "onnxruntime": "1.31"}
    return {
        **versions,
        "cpu": "A made-up CPU",
        "cores": 2,
        "memory_gib": 7.8,
        "system": "Linux made-up",
        "date": "2001-02-03",
        "minutes": 87.5,
    }


def _data() -> Study:
    return {
        "simulated": {
            "name": "gestured's simulator, cohort seed 0",
            "participants": 34,
            "performed": 3060,
            "cut": 3011,
            "lost": 49,
        },
        "real": {"name": "CapFingerId (made-up figures)", "subjects": 20, "gestures": 1801, "non_gestures": 350},
        "foreign": {"name": "foreign.npz", "participants": 20, "performed": 200, "cut": 199},
    }


def _methods() -> Study:
    found = {}
    for method, (title, family, published) in METHODS.items():
        tried = {"neighbours": 7} if method.endswith("knn") else {"C": 128.0, "gamma": 0.000488}
        shifted = {"C": 512.0, "gamma": 0.0001220703} if method.endswith("svm") else tried
        given = {"none": tried, "shift": shifted, "wide": tried}
        hyper = {"paper": given if published else None, "tuned": {**tried, "more": 3}}
        what = "One sentence of what it sees and how it decides."
        found[method] = {
            "title": title,
            "family": family,
            "paper": published is not None,
            "what": what,
            "hyperparameters": hyper,
        }
    return found


def _between(right: float, width: float = 0.03) -> Study:
    return {"right": right, "low": max(0.0, right - width), "high": min(1.0, right + 0.8 * width)}


def _strength(method: str) -> float:
    return {"st": 0.66, "tp": 0.62, "cnn": 0.80, "lstm": 0.90, "tcn": 0.95, "transformer": 0.93}.get(
        method.split("_")[0] if method[:2] in ("st", "tp") else method, 0.955
    )


def _cells(method: str, chance: random.Random) -> list[Study]:
    published = METHODS[method][2]
    cells = []
    for settings in ("paper", "tuned") if published else ("tuned",):
        for augmentation in ("none", "shift", "wide"):
            for protocol in ("paper", "padded", "clean", "participants", "real", "foreign"):
                right = _strength(method) + chance.uniform(-0.03, 0.02) + (0.01 if settings == "tuned" else 0.0)
                right += {"participants": -0.03, "real": -0.12, "foreign": -0.2}.get(protocol, 0.0)
                if augmentation == "shift":
                    right += 0.6 * (0.99 - right) if protocol == "paper" else 0.015
                figure = None if published is None or augmentation == "wide" else published[augmentation == "shift"]
                about = {"method": method, "settings": settings, "augmentation": augmentation, "protocol": protocol}
                data = protocol if protocol in ("real", "foreign") else "simulated"
                rest = {"data": data, "n": 459, "seeds": 3, "spread": 0.004, "published": figure, "train": 2601}
                rest |= {"seconds": 12.5}
                confusion = _confusion(right, chance) if protocol == "participants" else None
                cells.append({**about, **_between(right), **rest, "confusion": confusion})
    return cells


def _confusion(right: float, chance: random.Random) -> list[list[int]]:
    rows = []
    for k in range(10):
        row = [0] * 10
        for _ in range(45):
            row[k if chance.random() < right else (k + chance.choice((1, 1, 1, -1, 3))) % 10] += 1
        rows.append(row)
    return rows


def _copies(method: str, chance: random.Random) -> Study:
    leaky = chance.uniform(0.05, 0.25)
    gains = {"gain_leaky": leaky, "gain_clean": leaky * chance.uniform(0.05, 0.3)}
    return {
        "method": method,
        "settings": "paper",
        "test": 1836,
        "with_copy": 930,
        "with_version": 1800,
        "right_with_copy": 0.99,
        "right_without_copy": 0.71,
        **gains,
    }


def _tuning(method: str, chance: random.Random) -> Study:
    tried: list[Study] = [
        {"values": {"C": 2.0**k, "gamma": 2.0 ** (k - 12)}, "right": 0.6 + chance.random() / 3, "spread": 0.02}
        for k in range(6)
    ]
    return {"method": method, "candidates": tried, "chosen": max(tried, key=lambda row: row["right"])["values"]}


def _choices(chance: random.Random) -> list[Study]:
    table = {
        "wavelet": ("db2", ["haar", "db2", "sym4"]),
        "decay of the motion history image": ("0.9", ["0.8", "0.9", "linear"]),
        "what a bounding box is": ("above 10 % of the peak", ["above 0", "above 10 % of the peak"]),
    }
    return [
        {
            "choice": choice,
            "ours": ours,
            "method": "st_svm",
            "alternatives": [{"value": value, **_between(chance.uniform(0.6, 0.9))} for value in values],
        }
        for choice, (ours, values) in table.items()
    ]


def _run_time(method: str, chance: random.Random) -> list[Study]:
    recent = METHODS[method][1] in ("recurrent", "beyond the paper")
    kinds = [("tuned", "float32"), ("tuned", "int8")] if recent else [("tuned", "float64")]
    kinds += [("shipped", "float32")] if method in ("tp_rf", "lstm", "cnn_lstm") else []
    rows = []
    for settings, precision in kinds:
        median = 10 ** chance.uniform(1.7, 3.9)
        right = _strength(method) + chance.uniform(-0.03, 0.02)
        sizes = {"memory_bytes": int(median * 3000), "file_bytes": int(median * 900)}
        times = {"median_us": median, "p95_us": median * 1.4, "cold_us": median * 2.5, "front": False}
        lost = 0.02 if settings == "shipped" else 0.0
        field = {
            "wrong": 1 - right, "wrong_low": 0.9 - right * 0.9, "wrong_high": 1.03 - right, "error": 1 - right + lost,
            "error_low": 0.9 - right * 0.9, "error_high": 1.05 - right, "performed": 540,
        }  # fmt: skip
        real = {"wrong": 0.01, "error": 0.04, "performed": 3000}
        fields = {"simulated": field, "foreign": field, "real": real}
        about = {"method": method, "settings": settings, "precision": precision}
        rows.append({**about, **_between(right), **field, **times, **sizes, "fields": fields})
    return rows


def _said() -> list[Study]:
    found = []
    for k, group in enumerate(("taps", "swipes", "circles", "two fingers")):
        for kind, middle in (("provisional", -0.2), ("final", 0.2)):
            at = {f"p{q}_s": middle + 0.03 * k + 0.002 * (q - 50) for q in (10, 50, 90)}
            rest = {"n": 40, "wrong": 0.01 * k, "low": 0.0, "high": 0.08}
            found.append({"group": group, "kind": kind, **rest, **at})
    return found


def _calibration(method: str, chance: random.Random) -> Study:
    return {"method": method, "error": round(chance.uniform(0.01, 0.08), 4)}


def _online(method: str, chance: random.Random) -> Study:
    right = _strength(method) - 0.04
    rest = {
        "wrong": 0.03,
        "missed": 0.02,
        "extra": 0.012,
        "false_per_minute": 0.31,
        "latency_ms": {"p50": 133.0, "p95": 402.0},
    }
    published = {"tp_rf": 0.71, "lstm": 0.89, "cnn_lstm": 0.93}[method]
    return {"method": method, "gestures": 600, **_between(right), **rest, "published": published}
