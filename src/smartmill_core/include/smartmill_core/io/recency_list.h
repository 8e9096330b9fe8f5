#pragma once

#include <cstddef>
#include <list>
#include <optional>

namespace smartmill {

/// The members of a bounded set in the order of their last activity, so that a full set can do without the
/// one that has been quiet for longest.
template <class Member>
class RecencyList {
 public:
  /// A member's place in the list, until leave() or its end. The list must outlive it.
  class Place {
   public:
    Place(RecencyList& list, Member* member)
        : list_(list), at_(list.members_.insert(list.members_.end(), member)) {}
    ~Place() { leave(); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    /// The member was active.
    void touch() {
      if (at_) list_.members_.splice(list_.members_.end(), list_.members_, *at_);
    }
    void leave() {
      if (at_) list_.members_.erase(*at_);
      at_.reset();
    }

   private:
    RecencyList& list_;
    std::optional<typename std::list<Member*>::iterator> at_;
  };

  std::size_t size() const { return members_.size(); }
  /// nullptr: there are none.
  Member* quietest() const { return members_.empty() ? nullptr : members_.front(); }

 private:
  std::list<Member*> members_;
};

}  // namespace smartmill
