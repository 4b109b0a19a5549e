#!/usr/bin/python3
"""Reads mesh files with VTK and prints all that is in them, numbers as their bits; or has VTK write files for us to read.

    read_back.py FILE...                    .vtu, .vtp, .pvtu, .pvtp or, its first partition, .vtpd
    read_back.py --rewrite FILE.vtu DIR     writes FILE anew in every way VTK knows, and prints the names
    read_back.py --polygonal DIR            writes polygonal data of all kinds of cells, and prints the names

Needs Debian's python3-vtk9; no numpy.
"""

import json
import os
import struct
import sys

import vtk


class Errors:
    """Fails at the first error or warning that VTK reports."""

    def __init__(self, algorithm):
        for event in ("ErrorEvent", "WarningEvent"):
            algorithm.AddObserver(event, self)

    def __call__(self, source, event):
        sys.exit(f"VTK reports {event} from {source.GetClassName()}")


def read(path):
    reader = {
        ".vtk": vtk.vtkUnstructuredGridReader,
        ".vtp": vtk.vtkXMLPolyDataReader,
        ".pvtp": vtk.vtkXMLPPolyDataReader,
        ".pvtu": vtk.vtkXMLPUnstructuredGridReader,
        ".vtpd": vtk.vtkXMLPartitionedDataSetReader,
    }.get(os.path.splitext(path)[1], vtk.vtkXMLUnstructuredGridReader)()
    Errors(reader)
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutputDataObject(0)
    return data.GetPartition(0) if isinstance(data, vtk.vtkPartitionedDataSet) else data


def bits(values):
    return "".join(f" {struct.unpack('<Q', struct.pack('<d', float(value)))[0]:016x}" for value in values)


def values(array):
    return [array.GetComponent(t, c) for t in range(array.GetNumberOfTuples()) for c in range(array.GetNumberOfComponents())]


def describe(data):
    print(f"points{bits(x for point in range(data.GetNumberOfPoints()) for x in data.GetPoint(point))}")
    for number in range(data.GetNumberOfCells()):
        cell = data.GetCell(number)
        vertices = sorted_if(data.GetCellType(number) == 42, [cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())])
        print(f"cell {data.GetCellType(number)}{''.join(f' {vertex}' for vertex in vertices)}")
    texts = []
    for place, holder in (("point", data.GetPointData()), ("cell", data.GetCellData()), ("field", data.GetFieldData())):
        for index in range(holder.GetNumberOfArrays() if place != "field" else holder.GetNumberOfArrays()):
            array = holder.GetAbstractArray(index)
            if isinstance(array, vtk.vtkStringArray):
                texts.append((array.GetName(), [array.GetValue(k) for k in range(array.GetNumberOfValues())]))
            else:
                name = json.dumps(array.GetName())
                print(f"{place} {name} {array.GetNumberOfComponents()}{bits(values(array))}")
    for name, strings in texts:
        print(f"text {json.dumps(name)} {json.dumps(strings)}")


def sorted_if(condition, items):
    return sorted(items) if condition else items


def rewrite(path, directory):
    data = read(path)
    for mode, set_mode in (("ascii", "SetDataModeToAscii"), ("inline", "SetDataModeToBinary"), ("appended", "SetDataModeToAppended")):
        for compressor in ("none", "zlib", "lz4") if mode != "ascii" else ("none",):
            for order in ("little", "big"):
                for header in ("32", "64"):
                    for encode in (0, 1) if mode == "appended" else (0,):
                        if mode == "ascii" and (order, header) != ("little", "32"):
                            continue
                        name = f"{mode}-{compressor}-{order}-{header}-{encode}-{'lossy' if mode == 'ascii' else 'lossless'}.vtu"
                        writer = vtk.vtkXMLUnstructuredGridWriter()
                        Errors(writer)
                        getattr(writer, set_mode)()
                        writer.SetCompressor(
                            {"none": None, "zlib": vtk.vtkZLibDataCompressor(), "lz4": vtk.vtkLZ4DataCompressor()}[compressor]
                        )
                        (writer.SetByteOrderToBigEndian if order == "big" else writer.SetByteOrderToLittleEndian)()
                        (writer.SetHeaderTypeToUInt64 if header == "64" else writer.SetHeaderTypeToUInt32)()
                        writer.SetEncodeAppendedData(encode)
                        writer.SetFileName(os.path.join(directory, name))
                        writer.SetInputData(data)
                        writer.Write()
                        print(name)
    for version in (42, 51):
        for kind in ("ascii", "binary"):
            name = f"legacy-{version}-{kind}-{'lossy' if kind == 'ascii' else 'lossless'}.vtk"
            writer = vtk.vtkUnstructuredGridWriter()
            Errors(writer)
            writer.SetFileVersion(version)
            (writer.SetFileTypeToBinary if kind == "binary" else writer.SetFileTypeToASCII)()
            writer.SetFileName(os.path.join(directory, name))
            writer.SetInputData(data)
            writer.Write()
            print(name)


def polygonal(directory):
    points = vtk.vtkPoints()
    for k in range(18):
        points.InsertNextPoint(k, k * k, 1.0 / (k + 1))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    sections = (("Verts", [(0,), (1, 2)]), ("Lines", [(3, 4), (4, 5, 6)]), ("Polys", [(7, 8, 9), (7, 8, 9, 10)]), ("Strips", [(11, 12, 13, 14, 15)]))
    size = vtk.vtkIntArray()
    size.SetName("size")
    for name, rows in sections:
        cells = vtk.vtkCellArray()
        for row in rows:
            cells.InsertNextCell(len(row), row)
            size.InsertNextValue(len(row))
        getattr(data, f"Set{name}")(cells)
    data.GetCellData().AddArray(size)
    for name, writer in (
        ("polygonal.vtp", vtk.vtkXMLPolyDataWriter()),
        ("polygonal-42.vtk", vtk.vtkPolyDataWriter()),
        ("polygonal-51.vtk", vtk.vtkPolyDataWriter()),
        ("polygonal-binary.vtk", vtk.vtkPolyDataWriter()),
    ):
        Errors(writer)
        if "-42" in name:
            writer.SetFileVersion(42)
        if "binary" in name:
            writer.SetFileTypeToBinary()
        writer.SetFileName(os.path.join(directory, name))
        writer.SetInputData(data)
        writer.Write()
        print(name)


if __name__ == "__main__":
    if sys.argv[1] == "--rewrite":
        rewrite(*sys.argv[2:])
    elif sys.argv[1] == "--polygonal":
        polygonal(*sys.argv[2:])
    else:
        for argument in sys.argv[1:]:
            describe(read(argument))
