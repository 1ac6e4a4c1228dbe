/* Names of SOFA that the example uses, to check its syntax where SOFA is not installed. */
#include <iostream>
#include <string>
typedef double SReal;
#define SOFA_CLASS(one, other) typedef other Inherited
#define SOFA_EXPORT_DYNAMIC_LIBRARY
#define msg_error() std::cerr
namespace sofa {
namespace core { namespace objectmodel {
template <class T> struct Data {
    struct InitData { T value; };
    Data(const InitData &init) : value(init.value) {}
    const T &getValue() const { return value; }
    T value;
};
} }
namespace type {
template <class Real> struct Vec3 {
    Vec3(Real = 0, Real = 0, Real = 0) {}
    Real operator[](int) const { return 0; }
};
template <class Real> struct Rot { Vec3<Real> inverseRotate(const Vec3<Real> &v) const { return v; } };
template <class Real> struct Transform {
    Vec3<Real> getOrigin() const { return {}; }
    Rot<Real> getOrientation() const { return {}; }
};
template <class Real> struct SpatialVector { void setForce(const Vec3<Real> &) {} void setTorque(const Vec3<Real> &) {} };
}
namespace component { namespace haptics {
struct ForceFeedback {
    virtual ~ForceFeedback() {}
    virtual void init() {}
    virtual void computeForce(SReal, SReal, SReal, SReal, SReal, SReal, SReal, SReal &, SReal &, SReal &) = 0;
    virtual void computeWrench(const type::Transform<SReal> &, const type::SpatialVector<SReal> &,
                               type::SpatialVector<SReal> &) = 0;
    template <class T> typename core::objectmodel::Data<T>::InitData initData(core::objectmodel::Data<T> *, T value, const char *, const char *) {
        return {value};
    }
};
} }
}
