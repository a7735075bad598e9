"""A study that nobody computed: plausible in form, plainly invented in its numbers."""

from itertools import product
from typing import Any

from gestured.simulator import GESTURES

Study = dict[str, Any]
METHODS = {
    "st_svm": ("spatio-temporal features, support vector machine (RBF)", (0.58, 0.98)),
    "tp_knn": ("touch-pattern features, k nearest neighbours", (0.56, 0.98)),
    "tp_rf": ("touch-pattern features, random forest", (0.60, 0.98)),
    "mhi_cnn": ("CNN on motion history images", (0.77, 0.81)),
    "lstm": ("LSTM", (0.82, 0.97)),
    "cnn_lstm": ("CNN-LSTM", (0.89, 0.97)),
    "cnn_gru": ("CNN-GRU", None),
    "trajectory_gb": ("trajectory features, gradient boosting", None),
}
SHIPS = ("tp_rf", "lstm", "cnn_lstm")
PROTOCOLS = {"paper": 0.1, "padded": 0.08, "clean": 0.05, "participants": 0.0, "real": -0.1, "foreign": -0.2}


def made_study() -> Study:
    """Every part of the schema, filled."""
    about = {
        "version": "0.0-made-up", "command": "gestured-lab study --out report/", "seed": 0, "seeds": 3, "quick": False,
        "models": {"lstm": "ab" * 32}, "paper": "somebody, made up", "gestures": list(GESTURES),
    }  # fmt: skip
    machine = {"cpu": "A made-up CPU", "cores": 2, "date": "2001-02-03", "minutes": 87.5}
    data = {
        "simulated": {"name": "a simulator", "participants": 34, "performed": 3060, "cut": 3011, "lost": 49},
        "real": {"name": "CapFingerId (made-up figures)", "subjects": 20, "gestures": 1801, "non_gestures": 350},
        "foreign": {"name": "foreign.npz", "participants": 20, "performed": 200, "cut": 199},
    }
    return {
        "about": about,
        "machine": machine,
        "data": data,
        "methods": {method: _method(method) for method in METHODS},
        "cells": [cell for method in METHODS for cell in _cells(method)],
        "trials": [_trials(method) for method in METHODS],
        "copies": [_copies(method) for method in METHODS],
        "choices": [
            {"choice": "wavelet", "ours": "haar", "method": "st_svm",
             "alternatives": [{"value": value, **_between(0.7)} for value in ("haar", "db2")]},
        ],
        "run_time": [row for method in METHODS for row in _run_time(method)],
        "online": [_online(method) for method in SHIPS],
        "online_shipped": [_online(method) for method in SHIPS[1:]],
    }  # fmt: skip


def _strength(method: str) -> float:
    return 0.6 + 0.04 * list(METHODS).index(method)


def _between(right: float) -> Study:
    return {"right": right, "low": max(0.0, right - 0.03), "high": min(1.0, right + 0.02)}


def _method(method: str) -> Study:
    title, published = METHODS[method]
    tried = {"neighbours": 7} if method.endswith("knn") else {"C": 128.0, "gamma": 0.000488}
    shifted = {"C": 512.0, "gamma": 0.0001220703} if method.endswith("svm") else tried
    hyper = {"paper": {"none": tried, "shift": shifted} if published else None, "tuned": {**tried, "more": 3}}
    return {"title": title, "paper": published is not None, "hyperparameters": hyper}


def _cells(method: str) -> list[Study]:
    published, cells = METHODS[method][1], []
    for settings, augmentation, protocol in product(("paper", "tuned"), ("none", "shift"), PROTOCOLS):
        if published is None and settings == "paper":
            continue
        right = (
            _strength(method)
            + PROTOCOLS[protocol] / 2
            + 0.01 * (settings == "tuned")
            + 0.02 * (augmentation == "shift")
        )
        cells.append({
            "method": method, "settings": settings, "augmentation": augmentation, "protocol": protocol,
            "data": protocol if protocol in ("real", "foreign") else "simulated", **_between(right), "n": 459,
            "seeds": 3, "spread": 0.004, "published": published and published[augmentation == "shift"],
            "confusion": [[45 * (i == k) + 3 for i in range(10)] for k in range(10)],
        })  # fmt: skip
    return cells


def _trials(method: str) -> Study:
    strength = _strength(method)
    speed = {"slow": strength, "normal": strength + 0.01, "fast": strength - 0.13}
    return {"method": method, "speed": speed, "inclination": {str(n): strength - 0.02 * n for n in range(3)}}


def _copies(method: str) -> Study:
    return {
        "method": method, "settings": "paper", "test": 1836, "with_copy": 930,
        "right_with_copy": 0.99, "right_without_copy": 0.71, "gain_leaky": 0.2, "gain_clean": 0.02,
    }  # fmt: skip


def _run_time(method: str) -> list[Study]:
    rows = []
    for settings in ("tuned", "shipped") if method in SHIPS else ("tuned",):
        ships = settings == "shipped"
        right, median = _strength(method) + 0.05 * ships, 60.0 * 2 ** list(METHODS).index(method) + 7 * ships
        field = {
            "wrong": 1 - right, "wrong_low": 0.9 * (1 - right), "wrong_high": 1.1 * (1 - right),
            "error": 1.02 - right, "error_low": 0.9 * (1 - right), "error_high": 1.15 - right, "performed": 540,
        }  # fmt: skip
        rows.append({
            "method": method, "settings": settings, **_between(right), "median_us": median,
            "p95_us": 1.4 * median, "cold_us": 2.5 * median, "file_bytes": int(900 * median),
            "fields": {"simulated": field, "foreign": field, "real": {"wrong": 0.01, "error": 0.04, "performed": 3000}},
        })  # fmt: skip
    return rows


def _online(method: str) -> Study:
    return {
        "method": method, "gestures": 600, **_between(_strength(method)), "wrong": 0.03, "missed": 0.02,
        "false_per_minute": 0.31, "latency_ms": 133, "published": 0.9,
    }  # fmt: skip
