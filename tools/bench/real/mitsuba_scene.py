"""Tells Mitsuba 3 a scene file of Tallow: of its keys those that the scenes of bench.py use. Others are an error."""
import tomllib
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f


KEYS = {
    "camera": {"position", "target", "up", "fov", "fov_axis"},
    "environment": {"radiance", "file", "scale"},
    "light": {"type", "direction", "irradiance"},
    "material": {"name", "type", "color", "emission", "ior", "nonlinear", "alpha", "distribution"},
    "mesh": {"name", "shape", "file", "material", "flat", "transform"},
    "instance": {"mesh", "transform"},
}


def check(table):
    """Nothing is left out in silence. Film and render are for whoever calls."""
    assert not (tables := set(table) - set(KEYS) - {"film", "render"}), f"tables that are not told yet: {tables}"
    for name, known in KEYS.items():
        rows = table.get(name, [])
        for row in rows if isinstance(rows, list) else [rows]:
            assert not (keys := set(row) - known), f"keys of [{name}] that are not told yet: {keys}"
    assert "file" in table.get("environment", {}) or "scale" not in table.get("environment", {}), "scale without a file"


def load(path, width, height):
    """The scene of a file, on a film of so many pixels."""
    file = Path(path)
    table = tomllib.loads(file.read_text())
    check(table)
    scene = {"type": "scene", "sensor": sensor(table["camera"], width, height)}
    if "environment" in table:
        scene["sky"] = environment(table["environment"], file.parent)
    for i, light in enumerate(table.get("light", [])):
        scene[f"light{i}"] = sun(light)
    materials = {m["name"]: m for m in table.get("material", [])}
    placed = {mesh.get("name"): [] for mesh in table["mesh"]}
    for instance in table.get("instance", []):
        placed[instance["mesh"]].append(matrix(instance.get("transform", {})))
    for i, mesh in enumerate(table["mesh"]):
        stands = [matrix(mesh.get("transform", {}))]
        for j, to_world in enumerate(placed[mesh.get("name")] or stands):
            for k, shape in enumerate(shapes(mesh, materials, file.parent, to_world)):
                scene[f"shape{i}_{j}_{k}"] = shape
    return mi.load_dict(scene)


def sensor(camera, width, height):
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    view = T().look_at(origin=camera["position"], target=camera["target"], up=camera.get("up", [0, 1, 0]))
    return {"type": "perspective", "fov": camera["fov"], "fov_axis": camera.get("fov_axis", "y"), "to_world": view,
            "film": film}


def environment(table, folder):
    if "file" not in table:
        return {"type": "constant", "radiance": rgb(table["radiance"])}
    return {"type": "envmap", "filename": str(folder / table["file"]), "scale": table.get("scale", 1.0)}


def sun(table):
    assert table["type"] == "directional", table
    return {"type": "directional", "direction": table["direction"], "irradiance": rgb(table["irradiance"])}


def rgb(value):
    return {"type": "rgb", "value": value}


def matrix(transform):
    if isinstance(transform, list):
        return np.array(transform, float).reshape(4, 4)
    assert "rotate" not in transform, "rotations are not told yet"
    return np.diag([*np.broadcast_to(transform.get("scale", 1.0), 3), 1.0]) + np.pad(
        np.array(transform.get("translate", [0, 0, 0]), float)[:, None], ((0, 1), (3, 0)))


def shapes(mesh, materials, folder, to_world):
    """A shape for each material of the mesh."""
    material = materials.get(mesh.get("material"))
    if "shape" in mesh:
        yield simple_shape(mesh["shape"], material, to_world)
        return
    mtl, values, parts = read_obj(folder / mesh["file"])
    merged = [(None, [f for _, faces in parts for f in faces])] if material else parts
    for name, faces in merged:
        bsdf = surface(material) if material else mtl_surface(mtl[name], (folder / mesh["file"]).parent)
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(bsdf)
        if material and "emission" in material:
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": rgb(material["emission"])})
        yield triangles(values, faces, properties, to_world, mesh.get("flat", False))


def simple_shape(kind, material, to_world):
    assert kind in ("rectangle", "cube", "disk"), kind
    shape = {"type": kind, "to_world": T(to_world), "bsdf": surface(material)}
    if "emission" in material:
        shape["emitter"] = {"type": "area", "radiance": rgb(material["emission"])}
    return shape


def surface(m):
    """The BSDF of a `[[material]]` without textures."""
    color = rgb(m.get("color", [0.5] * 3))
    if m["type"] == "diffuse":
        return two_sided({"type": "diffuse", "reflectance": color})
    assert m["type"] == "coated", m
    coat = {"int_ior": m.get("ior", 1.5), "diffuse_reflectance": color, "nonlinear": m.get("nonlinear", False)}
    if m.get("alpha", 0.0) < 0.01:
        return two_sided({"type": "plastic", **coat})
    return two_sided({"type": "roughplastic", "alpha": m["alpha"], "distribution": m.get("distribution", "beckmann"), **coat})


def two_sided(bsdf):
    return {"type": "twosided", "bsdf": bsdf}


def mtl_surface(block, folder):
    """The BSDF of an MTL block as Tallow understands those without Ks and Pm: diffuse, with a normal map and a mask."""
    def bitmap(key, raw):
        return {"type": "bitmap", "filename": str(folder / block[key][-1]), "raw": raw}

    reflectance = bitmap("map_Kd", False) if "map_Kd" in block else rgb([float(x) for x in block["Kd"]])
    bsdf = {"type": "diffuse", "reflectance": reflectance}
    if "norm" in block:
        bsdf = {"type": "normalmap", "normalmap": bitmap("norm", True), "bsdf": bsdf}
    bsdf = two_sided(bsdf)
    return {"type": "mask", "opacity": bitmap("map_d", True), "bsdf": bsdf} if "map_d" in block else bsdf


def read_mtl(path):
    blocks, block = {}, {}
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0] == "newmtl":
            block = blocks[words[1]] = {}
        elif words and not words[0].startswith("#"):
            block[words[0]] = words[1:]
    return blocks


def read_obj(path):
    """Blocks of the material file by name; positions, texture coordinates and normals; and (name of a material, triangles),
    whose corners are an index of each, -1 where there is none."""
    values, parts, name, mtl = {"v": [], "vt": [], "vn": []}, {}, None, {}
    for line in path.read_text().splitlines():
        key, *words = line.split() or [""]
        if key in values:
            values[key].append([float(x) for x in words[:3]])
        elif key == "mtllib":
            mtl = read_mtl(path.parent / words[0])
        elif key == "usemtl":
            name = words[0]
        elif key == "f":
            corners = [corner(word, values) for word in words]
            fan = parts.setdefault(name, [])
            fan.extend((corners[0], b, c) for b, c in zip(corners[1:], corners[2:]))
    return mtl, [np.array(v) for v in values.values()], list(parts.items())


def corner(word, values):
    indices = [int(x) if x else 0 for x in (word + "//").split("/")[:3]]
    return tuple(i - 1 if i > 0 else len(v) + i if i else -1 for i, v in zip(indices, values.values()))


def triangles(values, faces, properties, to_world, flat):
    """A Mitsuba mesh of a part. A part has normals or texture coordinates at all of its corners or counts as without."""
    corners, indices = np.unique(np.array(faces).reshape(-1, 3), axis=0, return_inverse=True)
    has = corners.min(axis=0) >= 0
    normals = bool(has[2]) and not flat
    mesh = mi.Mesh("part", len(corners), len(faces), properties, normals, bool(has[1]))
    params = mi.traverse(mesh)
    params["vertex_positions"] = np.ravel(values[0][corners[:, 0]] @ to_world[:3, :3].T + to_world[:3, 3])
    params["faces"] = np.ravel(indices)
    if has[1]:  # v points up in OBJ files, down in Mitsuba
        uv = values[1][corners[:, 1], :2]
        params["vertex_texcoords"] = np.ravel(np.stack([uv[:, 0], 1.0 - uv[:, 1]], 1))
    if normals:
        turned = values[2][corners[:, 2]] @ np.linalg.inv(to_world[:3, :3])
        params["vertex_normals"] = np.ravel(turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-30))
    params.update()
    return mesh
