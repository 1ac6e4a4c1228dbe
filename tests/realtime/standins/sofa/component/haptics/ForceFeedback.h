/* Names of SOFA that the example uses, to check its syntax where SOFA is not installed. */
#include <iostream>
#include <string>
typedef double SReal;
#define SOFA_CLASS(one, other) typedef other Inherited
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
namespace defaulttype {
template <class Real> struct SolidTypes {
    struct Vec3 {
        Vec3(Real = 0, Real = 0, Real = 0) {}
        Real operator[](int) const { return 0; }
    };
    struct Rot { Vec3 inverseRotate(const Vec3 &v) const { return v; } };
    struct Transform { Vec3 getOrigin() const { return {}; } Rot getOrientation() const { return {}; } };
    struct SpatialVector { void setForce(const Vec3 &) {} void setTorque(const Vec3 &) {} };
};
}
namespace component { namespace haptics {
struct ForceFeedback {
    typedef defaulttype::SolidTypes<SReal> Types;
    virtual ~ForceFeedback() {}
    virtual void init() {}
    virtual void computeForce(SReal, SReal, SReal, SReal, SReal, SReal, SReal, SReal &, SReal &, SReal &) = 0;
    virtual void computeWrench(const Types::Transform &, const Types::SpatialVector &, Types::SpatialVector &) = 0;
    template <class T> typename core::objectmodel::Data<T>::InitData initData(core::objectmodel::Data<T> *, T value, const char *, const char *) {
        return {value};
    }
};
} }
}
