// Unity: the managed side of unity.c. Call Feel from the thread that serves the device, about 1,000 times a second.
using System;
using System.Runtime.InteropServices;

public sealed class EpsmeshTool : IDisposable
{
    const string Library = "epsmesh_unity";

    [DllImport(Library)] static extern IntPtr epsmesh_unity_open(string path, double radius, double most);
    [DllImport(Library)] static extern void epsmesh_unity_close(IntPtr tool);
    [DllImport(Library)] static extern int epsmesh_unity_feel(IntPtr tool, double[] tip, double[] force, out double error);

    IntPtr tool;
    readonly double[] force = new double[3]; // nothing is allocated in the loop

    public EpsmeshTool(string path, double radius, double most)
    {
        tool = epsmesh_unity_open(path, radius, most);
        if (tool == IntPtr.Zero) throw new ArgumentException(path + " is no model, or radius or force is not positive");
    }

    // Force and its error bar, in N. A status other than 0 (ok) or 1 (no contact) means that the force fades: see epsmesh.h.
    public double[] Feel(double[] tip, out double error, out int status)
    {
        status = epsmesh_unity_feel(tool, tip, force, out error);
        return force;
    }

    public void Dispose()
    {
        if (tool != IntPtr.Zero) epsmesh_unity_close(tool);
        tool = IntPtr.Zero;
    }
}
